"""The equations of motion: kinematics, rotation, translation, and the whole vector field."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._attitude import attitude_rate as attitude_rate
    from ._attitude import quaternion_of as quaternion_of
    from ._attitude import quaternion_product as quaternion_product
    from ._attitude import rotation_matrix as rotation_matrix
    from ._field import Inputs as Inputs
    from ._field import Instant as Instant
    from ._field import Model as Model
    from ._field import State as State
    from ._field import StepAverage as StepAverage
    from ._field import floor as floor
    from ._field import instant as instant
    from ._field import motor_torque as motor_torque
    from ._field import port_forces as port_forces
    from ._field import prescribed_instant as prescribed_instant
    from ._field import speed_driven as speed_driven
    from ._field import torque_driven as torque_driven
    from ._forces import ELASTIC_PORTS as ELASTIC_PORTS
    from ._forces import TORQUE_PORTS as TORQUE_PORTS
    from ._forces import TURNING_PORTS as TURNING_PORTS
    from ._forces import ContactForces as ContactForces
    from ._forces import RotationMoment as RotationMoment
    from ._forces import Torques as Torques
    from ._forces import TurningLaws as TurningLaws
    from ._forces import actuated as actuated
    from ._forces import body_torques as body_torques
    from ._forces import combined as combined
    from ._forces import command_times as command_times
    from ._forces import contact_forces as contact_forces
    from ._forces import contact_signals as contact_signals
    from ._forces import free_torques as free_torques
    from ._forces import initial_memory as initial_memory
    from ._forces import mount_signals as mount_signals
    from ._forces import mount_tensions as mount_tensions
    from ._forces import rest_memory as rest_memory
    from ._forces import rolling_torques as rolling_torques
    from ._forces import shaft_torques as shaft_torques
    from ._forces import torques as torques
    from ._hold import free_projector as free_projector
    from ._hold import held as held
    from ._hold import held_directions as held_directions
    from ._hold import hold_obstacle as hold_obstacle
    from ._hold import same_contacts as same_contacts
    from ._kinematics import Rolling as Rolling
    from ._kinematics import incompatibility as incompatibility
    from ._kinematics import position_input as position_input
    from ._kinematics import radius_under as radius_under
    from ._kinematics import rolling as rolling
    from ._kinematics import rolling_radius as rolling_radius
    from ._kinematics import rolling_under as rolling_under
    from ._kinematics import sphere_velocity as sphere_velocity
    from ._kinematics import spin_axes as spin_axes
    from ._kinematics import surface_shape as surface_shape
    from ._kinematics import wheel_shape as wheel_shape
    from ._kinematics import wheel_speeds as wheel_speeds
    from ._mobility import Mobility as Mobility
    from ._mobility import Weight as Weight
    from ._mobility import fitting_speeds as fitting_speeds
    from ._mobility import mobility as mobility
    from ._mobility import sliding as sliding
    from ._mobility import weight as weight
    from ._pointwise import Pointwise as Pointwise
    from ._pointwise import pointwise_shape_acceleration as pointwise_shape_acceleration
    from ._remarks import Sliding as Sliding
    from ._remarks import driving_remarks as driving_remarks
    from ._remarks import sliding_of as sliding_of
    from ._remarks import sliding_remarks as sliding_remarks
    from ._rotation import drive_forces as drive_forces
    from ._rotation import external_force as external_force
    from ._rotation import inertia_at as inertia_at
    from ._rotation import minimum_normal_force as minimum_normal_force
    from ._rotation import rotation_response as rotation_response
    from ._rotation import turned as turned
    from ._sensors import sensor_readings as sensor_readings
    from ._small import pseudoinverse as pseudoinverse
    from ._translation import TRANSLATIONS as TRANSLATIONS
    from ._translation import AbstractTranslation as AbstractTranslation
    from ._translation import Coupled as Coupled
    from ._translation import ElasticState as ElasticState
    from ._translation import LinearSystem as LinearSystem
    from ._translation import Motion as Motion
    from ._translation import Paper as Paper
    from ._translation import PortInputs as PortInputs
    from ._translation import check_model as check_model
    from ._translation import flatten as flatten
    from ._translation import free_system as free_system
    from ._translation import linear_system as linear_system
    from ._translation import unflatten as unflatten

__getattr__, __dir__ = lazy_face(__name__)
