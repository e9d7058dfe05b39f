"""The notebooks of `python/notebooks`: they run without an error, show figures, and are in git without outputs."""

import sys

import conftest
import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

NOTEBOOKS = sorted((conftest.ROOT / "python" / "notebooks").glob("*.ipynb"))
#: Limit of one cell, s. A notebook takes less than 60 s on two cores; the limit leaves room for a busy machine.
CELL_LIMIT_S = 240


class _OwnKernel(KernelSpecManager):
    """Runs kernels with the Python of the tests, whatever kernels the machine has."""

    def get_kernel_spec(self, kernel_name):
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return KernelSpec(argv=command, display_name=kernel_name, language="python")


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_notebooks_are_the_four_of_the_book():
    page = (conftest.ROOT / "docs" / "src" / "how-to" / "use-from-python.md").read_text()
    names = ["a-strangers-session", "from-log-to-c-header", "my-first-log", "pressure-or-temperature"]
    assert [path.stem for path in NOTEBOOKS] == names
    assert all(f"`python/notebooks/{path.name}`" in page for path in NOTEBOOKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_in_git_has_no_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code_cells(notebook))
    assert any("assert " in cell.source for cell in code_cells(notebook)), "the notebook checks no claim"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_executes_without_error_and_shows_figures(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    manager = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=_OwnKernel())
    resources = {"metadata": {"path": str(tmp_path)}}
    # A cell with an error, such as a failed assertion, raises CellExecutionError.
    NotebookClient(notebook, km=manager, timeout=CELL_LIMIT_S, resources=resources).execute()
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "error"]
    kinds = [kind for output in outputs for kind in output.get("data", {})]
    assert "image/png" in kinds
    assert any(output.output_type == "stream" and output.name == "stdout" for output in outputs), "no answer is printed"
    assert not [output.text for output in outputs if output.output_type == "stream" and output.name == "stderr"]
