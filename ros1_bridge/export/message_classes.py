"""The classes of ROS messages on a computer without ROS: made by genpy from the definitions that rosbags has.

The package mcap-ros1-support brings genpy.  Types, fields and checksums (MD5) are those of ROS Noetic.
"""

import contextlib
import importlib
import sys
from types import ModuleType
from typing import Any, Dict, Iterator

from mrl_driver.errors import ConfigError

_NAMES = {
    "diagnostic_msgs": "DiagnosticArray DiagnosticStatus KeyValue",
    "geometry_msgs": "Transform TransformStamped Twist",
    "nav_msgs": "Odometry",
    "rosgraph_msgs": "Log",
    "sensor_msgs": "BatteryState FluidPressure Illuminance Imu JointState Range RelativeHumidity Temperature",
    "std_msgs": "Bool Float32 Float32MultiArray Header String UInt16",
    "tf2_msgs": "TFMessage",
}
KINDS = tuple(f"{package}/{name}" for package, names in _NAMES.items() for name in names.split())
"""The types that `ros1_bridge.topics` and this folder import."""
EXTRA = "pip install 'mrl-driver[export]'"  # installs what an export needs where ROS is missing
_TF_MESSAGE = "geometry_msgs/TransformStamped[] transforms\n"  # the one definition that rosbags lacks
_LINE = "=" * 80 + "\n"
_ENOUGH_BYTES = 1 << 16


def provide() -> None:
    """Let this process import modules of messages: ROS's, or else classes made here; ConfigError without both."""
    try:
        for package in _NAMES:
            importlib.import_module(f"{package}.msg")
        importlib.import_module("genpy")
    except ImportError:
        _install(made())


def made() -> Dict[str, Any]:
    """Return the classes by type, and `genpy/Time`; raise ConfigError if a package of the extra `export` is missing."""
    with needs_extra():
        from mcap.records import Schema
        from mcap_ros1.decoder import DecoderFactory
    # one message that has all types as its fields: genpy makes one module, and a class serves all that contain it
    fields = "".join(f"{kind} {_field(kind)}\n" for kind in KINDS)
    text = fields + "".join(
        f"{_LINE}MSG: {kind}\n{definition}" for kind, definition in _definitions().items()
    )
    decode = DecoderFactory().decoder_for("ros1", Schema(1, text.encode(), "ros1msg", "mrl_driver/All"))
    assert decode is not None
    example = decode(bytes(_ENOUGH_BYTES))
    classes = {kind: type(getattr(example, _field(kind))) for kind in KINDS}
    return {**classes, "genpy/Time": type(classes["std_msgs/Header"]().stamp)}


@contextlib.contextmanager
def needs_extra() -> Iterator[None]:
    """Raise ConfigError for a package of the extra that is not installed."""
    try:
        yield
    except ImportError as error:
        package = (error.name or str(error)).partition(".")[0]
        raise ConfigError(
            f"the Python package {package} is missing, expected it or ROS; install it with: {EXTRA}"
        ) from None


def _field(kind: str) -> str:
    return kind.lower().replace("/", "_")


def _definitions() -> Dict[str, str]:
    """The definitions of all types, with those that they contain, by type."""
    with needs_extra():
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(_TF_MESSAGE, "tf2_msgs/msg/TFMessage"))
    found: Dict[str, str] = {}
    for kind in KINDS:
        whole, _ = store.generate_msgdef(kind.replace("/", "/msg/"))
        own, *others = whole.split(_LINE)
        found[kind] = own
        for other in others:
            head, _, definition = other.partition("\n")
            found[head[len("MSG: ") :]] = definition
    return found


def _install(classes: Dict[str, Any]) -> None:
    """Put the classes into modules of this process, named as those of ROS."""
    for kind, made_class in classes.items():
        package, _, name = kind.partition("/")
        module = package if package == "genpy" else f"{package}.msg"
        for each in {package, module}:
            if not isinstance(sys.modules.get(each), ModuleType):
                sys.modules[each] = ModuleType(each, "Made from definitions, because ROS is not installed.")
        vars(sys.modules[module])[name] = made_class
        if module != package:
            vars(sys.modules[package])["msg"] = sys.modules[module]
