"""The command line: parse, call, print."""

from ._frame import COMMANDS as COMMANDS
from ._frame import build_app as build_app
from ._frame import main as main
from ._frame import run as run
from ._options import Json as Json
from ._options import emit as emit
