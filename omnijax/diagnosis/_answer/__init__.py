"""What comes back: verdict, names, learned terms, gaps, pictures."""

from .answer import baseline_table as baseline_table
from .answer import named as named
from .answer import notes as notes
from .answer import plain_where as plain_where
from .answer import score_table as score_table
from .answer import separating as separating
from .evidence import AbstractEvidence as AbstractEvidence
from .fitted_runs import shown_by_fitted_runs_alone as shown_by_fitted_runs_alone
from .gap import gaps as gaps
from .judges import JUDGES as JUDGES
from .named_effect import Named as Named
from .named_effect import OutputGap as OutputGap
from .result import Diagnosis as Diagnosis
from .rig_evidence import RigEvidence as RigEvidence
from .shown import Shown as Shown
from .shown import noise_remarks as noise_remarks
from .shown import noise_table as noise_table
from .shown import shown_noise as shown_noise
from .shown import white_levels as white_levels
from .shown import wrong as wrong
from .sizes import Sizes as Sizes
from .sizes import effect_sizes_on_held_out as effect_sizes_on_held_out
from .stretches import Stretch as Stretch
from .stretches import stretches as stretches
from .verdict import Verdict as Verdict
from .verdict import judge as judge
