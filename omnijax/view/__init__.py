"""Pages to look at: replay of one run, and a page to explore rigs with sliders."""

from ._replay import write_replay as write_replay
from ._saved import rig_of_run as rig_of_run
from ._scene import machine_scene as machine_scene
from ._serve import serve as serve
