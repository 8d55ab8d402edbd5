"""Studies from options and files: what they ask, and their starters and pages."""

from .page import Results as Results
from .page import Switch as Switch
from .page import deliver as deliver
from .page import finish as finish
from .page import made_by_rig as made_by_rig
from .page import worked as worked
from .starter import study_text as study_text
from .starter import template as template
from .starter import usual_speeds as usual_speeds
from .study import AskedStudy as AskedStudy
from .study import asked_of as asked_of
from .study import study_lines as study_lines
from .study import study_summary as study_summary
