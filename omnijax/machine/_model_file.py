"""A machine of the user's: a Python file with a class that derives from `AbstractMachine`."""

from pathlib import Path

from .._errors import InputError
from .._reading import TEXT, read_bytes
from .._users_module import run_module
from ._base import AbstractMachine
from ._file import MachineFile


def load_model(path: str | Path) -> MachineFile:
    """The machine of a Python file: an instance named `machine`, or the only class without one.

    The file is run.  Raises `InputError` where it cannot be, or defines no machine.
    """
    path = Path(path)
    try:
        text = read_bytes(path, TEXT)
    except OSError:
        raise InputError(f"{path}: no such Python file of a machine.") from None
    try:
        module = run_module(text, path)
    except Exception as error:  # whatever the user's file does wrong is the user's to know
        raise InputError(f"{path}: cannot be run: {type(error).__name__}: {error}") from error
    machine = getattr(module, "machine", None)
    if machine is None:
        classes = [
            v for v in vars(module).values()
            if isinstance(v, type) and issubclass(v, AbstractMachine)
            and v.__module__ == module.__name__
        ]  # fmt: skip
        if len(classes) != 1:
            raise InputError(
                f"{path}: defines {len(classes)} machines; give one class that derives from "
                "omnijax.machine.AbstractMachine, or an instance named `machine`."
            )
        try:
            machine = classes[0]()
        except Exception as error:
            raise InputError(f"{path}: {classes[0].__name__}() fails: {error}") from error
    if not isinstance(machine, AbstractMachine):
        raise InputError(f"{path}: `machine` must derive from AbstractMachine, but is {machine!r}.")
    wrong = [k for k in machine.uncertainty if not hasattr(machine, k)]
    if wrong:
        raise InputError([f"`uncertainty` names {k!r}, which is no field." for k in wrong], path)
    return MachineFile(machine, uncertainty=dict(machine.uncertainty), source=str(path))
