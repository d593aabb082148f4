#pragma once

namespace alidade::cli {

/// From now on a few failed allocations are survived out of a reserve: what runs while an error is on its way (the
/// destructors of a JSON document, the removal of unfinished files) may allocate, and would end the process. What ends
/// it all the same says so in the one line of any internal error, with exit code 1.
void prepare_for_out_of_memory();

/// That line, without an allocation.
void tell_out_of_memory();

}  // namespace alidade::cli
