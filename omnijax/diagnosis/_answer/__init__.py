"""What comes back: verdict, names, learned terms, gaps, pictures."""

from .answer import baseline_table as baseline_table
from .answer import learned_table as learned_table
from .answer import named as named
from .answer import notes as notes
from .answer import plain_where as plain_where
from .answer import score_table as score_table
from .answer import separating as separating
from .evidence import AbstractEvidence as AbstractEvidence
from .result import Diagnosis as Diagnosis
from .result import Gap as Gap
from .result import Named as Named
from .rig_evidence import RigEvidence as RigEvidence
from .verdict import judge as judge
