"""What `Result.require()` raises. What is wrong with the input is a ValueError instead."""


class EstimateError(RuntimeError):
    """There is no estimate that stands: the verdict's sentence, and what to add."""


class CannotDetermine(EstimateError):
    """The data do not determine it; the sentence names what is missing. The command's exit code 4."""


class NoConvergence(EstimateError):
    """The solve did not converge. The command's exit code 5."""


class NotTrusted(EstimateError):
    """There is an estimate, but its own checks speak against it. The command's exit code 6."""
