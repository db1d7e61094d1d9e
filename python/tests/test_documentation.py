"""Every public name has a docstring and a type."""

import inspect
import os
from pathlib import Path

import seafix as sf


def members():
    for name in sf.__all__:
        value = getattr(sf, name)
        if name != "__version__":
            yield name, value
            if inspect.isclass(value):
                for key, member in sorted(vars(value).items()):
                    if not key.startswith("_"):
                        yield f"{name}.{key}", member
            elif inspect.ismodule(value):
                for key in sorted(value.__all__):
                    yield f"{name}.{key}", getattr(value, key)


def test_every_public_name_has_a_docstring():
    # The fields of a data class are described by its own docstring.
    fields = {f"Shard.{key}" for key in sf.Shard.__dataclass_fields__}
    without = [name for name, value in members() if not inspect.getdoc(value) and name not in fields]
    # Attributes of an instance that a Python class sets in its constructor are no members of the class.
    assert not without


def test_every_compiled_name_has_a_type():
    stub = (Path(sf.__file__).parent / "_seafix.pyi").read_text(encoding="utf-8")
    assert (Path(sf.__file__).parent / "py.typed").is_file()
    for name, _ in members():
        head, _, tail = name.partition(".")
        if hasattr(sf._seafix, head):
            section = stub[stub.index(f"class {head}") :] if tail else stub
            assert f"def {tail or head}(" in section or f"class {head}" in section and not tail, name


def test_a_docstring_states_arguments_errors_and_result():
    for name, value in members():
        text = inspect.getdoc(value) or ""
        if inspect.isbuiltin(value) or inspect.isfunction(value):
            assert "Returns\n-------" in text, name


def reference():
    """The page `docs/python-api.md`: every public name with its docstring."""
    lines = [
        "# Python API",
        "",
        "Every public name of the package, with the text that `help(seafix)` prints. [Python](python.md) introduces it.",
    ]
    for name, value in members():
        try:
            signature = str(inspect.signature(value)) if callable(value) else ""
        except ValueError:
            signature = ""
        level = "###" if "." in name else "##"
        lines += ["", f"{level} {name}", "", "```text", f"{name}{signature}", "", inspect.getdoc(value) or "", "```"]
    return "\n".join(lines) + "\n"


def test_the_reference_has_every_docstring():
    page = Path(__file__).parents[2] / "docs" / "python-api.md"
    if "SEAFIX_UPDATE" in os.environ:
        page.write_text(reference(), encoding="utf-8")
    assert page.read_text(encoding="utf-8") == reference(), "run the tests once with SEAFIX_UPDATE=1"
