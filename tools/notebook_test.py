#!/usr/bin/env python3
"""Runs a notebook as a reader would, and fails where one of its cells does: notebook_test.py NOTEBOOK [NOTEBOOK …], the module
in PYTHONPATH. Exit 77 where nbclient is not installed."""
import sys

try:
    import nbformat
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError
except ImportError as missing:
    print(f"SKIPPED: {missing.name} is not installed")
    sys.exit(77)


def main(files):
    for file in files:
        notebook = nbformat.read(file, as_version=4)
        if any(cell.get("outputs") for cell in notebook.cells):
            print(f"{file}: stands in the tree with outputs; clear them")
            return 1
        try:
            NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
        except CellExecutionError as error:
            print(f"{file}: {error}")
            return 1
        shown = sum(any("image/png" in output.get("data", {}) for output in cell.outputs) for cell in notebook.cells
                    if cell.cell_type == "code")
        print(f"{file}: {len(notebook.cells)} cells, {shown} figures")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
