"""What the machine is, and the files that say so."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from .._errors import InputError as InputError
    from .._errors import did_you_mean as did_you_mean
    from ._batch import check_one_rig as check_one_rig
    from ._check_effects import law_places as law_places
    from ._directions import ANGLES as ANGLES
    from ._facts import FACTS as FACTS
    from ._facts import derived as derived
    from ._facts import direction_angles as direction_angles
    from ._facts import wheel_facts as wheel_facts
    from ._json_schema import effect_schema as effect_schema
    from ._json_schema import json_schema as json_schema
    from ._kinds import kind_of as kind_of
    from ._load import parse_rig as parse_rig
    from ._machine import Closure as Closure
    from ._machine import Contact as Contact
    from ._machine import Mount as Mount
    from ._machine import Platform as Platform
    from ._machine import Rig as Rig
    from ._machine import Sphere as Sphere
    from ._machine import Wheels as Wheels
    from ._machine import grouped_profiles as grouped_profiles
    from ._machine import place_law as place_law
    from ._open import as_rig as as_rig
    from ._open import bundled_rigs as bundled_rigs
    from ._open import load_rig as load_rig
    from ._open import rig_notes as rig_notes
    from ._open import rig_path as rig_path
    from ._open import rig_tables as rig_tables
    from ._parameters import ParameterInfo as ParameterInfo
    from ._parameters import UnknownParameter as UnknownParameter
    from ._parameters import law_quantity as law_quantity
    from ._parameters import parameter_info as parameter_info
    from ._parameters import parameter_paths as parameter_paths
    from ._parameters import put_parameter as put_parameter
    from ._parameters import read_parameter as read_parameter
    from ._placed import Acting as Acting
    from ._placed import Placed as Placed
    from ._placed import acting as acting
    from ._placed import law_memory as law_memory
    from ._placed import law_output as law_output
    from ._placed import law_rate as law_rate
    from ._placed import over_wheels as over_wheels
    from ._placed import put_wheels as put_wheels
    from ._placed import take_wheels as take_wheels
    from ._placed import total_over_wheels as total_over_wheels
    from ._quantities import Quantity as Quantity
    from ._quantities import as_number as as_number
    from ._save import files_of_rig as files_of_rig
    from ._save import law_texts as law_texts
    from ._save import rig_identity as rig_identity
    from ._save import rig_problems as rig_problems
    from ._save import rig_text as rig_text
    from ._save import save_laws as save_laws
    from ._save import save_rig as save_rig
    from ._schema import GROUPS as GROUPS
    from ._schema import MOST_ROLLERS as MOST_ROLLERS
    from ._schema import MOST_WHEELS as MOST_WHEELS
    from ._schema import channels as channels
    from ._typed import check_real as check_real
    from ._typed import typed_above_zero as typed_above_zero
    from ._typed import typed_number as typed_number
    from ._typed import typed_numbers as typed_numbers
    from ._typed import whole_number as whole_number
    from ._uncertain import CENTRE as CENTRE
    from ._uncertain import DIRECTIONS as DIRECTIONS
    from ._uncertain import GRAVITY as GRAVITY
    from ._uncertain import SENSOR as SENSOR
    from ._uncertain import closed_numbers as closed_numbers
    from ._uncertain import open_paths as open_paths
    from ._uncertain import uncertain_numbers as uncertain_numbers
    from ._units import GRAVITIES as GRAVITIES
    from ._units import converted as converted
    from ._upright import up as up
    from ._upright import upright as upright
    from ._user_laws import carried_laws as carried_laws
    from ._user_laws import file_of as file_of
    from ._user_laws import load_laws as load_laws
    from ._user_laws import rigs_laws as rigs_laws
    from ._values import get_parameter as get_parameter
    from ._values import set_parameter as set_parameter

__getattr__, __dir__ = lazy_face(__name__)
