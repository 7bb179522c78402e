import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from logs.importers.columns.column_motion import read_column_motion
from logs.importers.motion_log import read_motion
from logs.importers.open_log import open_log
from tests.logs.importers.columns.column_files import AIRSPEED, RATE, TABLE, WIND_EAST, circle, write_log
from world.errors import LogError

ROOT = Path(__file__).parents[4]
THOR = ROOT / "examples" / "real" / "thor75"


def test_each_column_arrives_in_si_units(tmp_path: Path) -> None:
    motion = read_motion(write_log(tmp_path))
    columns = circle()
    assert motion.inertial.values[:, 2] == pytest.approx(columns["az"])
    assert motion.inertial.values[:, 5] == pytest.approx(np.radians(columns["r"]))
    assert motion.attitude.values[:, 2] == pytest.approx(RATE * columns["t"])
    assert motion.height.values[:, 0] == pytest.approx(columns["alt"])
    assert motion.battery.values[7] == pytest.approx([11.1, 12.0])
    # Nose up is positive in a `MotionLog`, and an elevator's trailing edge down in a table.
    assert motion.controls.values[:, 0] == pytest.approx(-np.radians(columns["ele"]))
    assert motion.controls.values[:, 1] == pytest.approx(np.radians(columns["ail"]))
    assert motion.controls.values[:, 3] == pytest.approx(0.01 * columns["thr"])
    assert motion.angles == (True, True, True)
    # At 500 m the density is 0.9529 of that at sea level (standard atmosphere).
    assert motion.airspeed.values[0, 0] == pytest.approx(AIRSPEED * math.sqrt(0.9529), abs=0.01)


def test_a_log_without_wind_gets_it_from_the_triangle_of_velocities(tmp_path: Path) -> None:
    wind = read_motion(write_log(tmp_path)).wind
    assert np.abs(wind.values - [0.0, WIND_EAST]).max() < 0.35
    assert wind.values[30:-30].mean(axis=0) == pytest.approx([0.0, WIND_EAST], abs=0.05)


def test_other_frames_signs_and_units_give_the_same_motion(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    columns = circle()
    other = {
        "q": -np.radians(columns["q"]),
        "r": -np.radians(columns["r"]),
        "az": -columns["az"] / 9.80665,
        "yaw": 90.0 - columns["yaw"],
        "vd": -100.0 * columns["vd"],
        "ele": 1500.0 - 10.0 * columns["ele"],
        "thr": 1000.0 + 10.0 * columns["thr"],
    }
    table = TABLE
    for before, after in (
        ('"q", unit = "deg/s"', '"q", unit = "rad/s", frame = "FLU"'),
        ('"r", unit = "deg/s"', '"r", unit = "rad/s", frame = "FLU"'),
        ('"az", unit = "m/s2"', '"az", unit = "g", frame = "FLU"'),
        ('"yaw", unit = "deg"', '"yaw", unit = "deg", frame = "ENU"'),
        ('"vd", unit = "m/s", frame = "NED"', '"vd", unit = "cm/s", frame = "ENU"'),
        ('"thr", unit = "%"', '"thr", unit = "us"'),
        ('"ele", unit = "deg"', '"ele", unit = "deg", sign = -1, scale = 0.1, offset = -150.0'),
    ):
        assert before in table
        table = table.replace(before, after)
    first = read_motion(write_log(tmp_path / "a"))
    second = read_motion(write_log(tmp_path / "b", table, **other))
    for name in ("inertial", "velocity", "controls"):
        assert getattr(second, name).values == pytest.approx(getattr(first, name).values)
    turned = second.attitude.values - first.attitude.values
    assert np.remainder(turned + 1.0, 2.0 * math.pi) == pytest.approx(1.0)


@pytest.mark.parametrize("frame", ["NED", "ENU"])
def test_a_quaternion_is_roll_pitch_and_yaw(tmp_path: Path, frame: str) -> None:
    """A topic of PX4 or ROS has no angles; SciPy's rotations are the reference."""
    (tmp_path / "angles").mkdir()
    (tmp_path / "quaternion").mkdir()
    columns = circle()
    angles = [columns[name] for name in ("yaw", "pitch", "roll")]
    if frame == "ENU":
        # From the body's axes forward, left, up to east, north, up.
        angles = [90.0 - angles[0], -angles[1], angles[2]]
    x, y, z, w = Rotation.from_euler("ZYX", np.column_stack(angles), degrees=True).as_quat().T
    lines = [line for line in TABLE.splitlines() if not line.startswith(("roll =", "pitch =", "yaw ="))]
    lines += [f'quaternion_{part} = {{ column = "q[{k}]" }}' for k, part in enumerate("wxyz")]
    table = "\n".join(lines).replace('"q[0]"', f'"q[0]", frame = "{frame}"')
    parts = {f"q[{k}]": part for k, part in enumerate((w, x, y, z))}
    expected = read_motion(write_log(tmp_path / "angles"))
    path = write_log(tmp_path / "quaternion", table, **parts)
    found = read_motion(path)
    turned = found.attitude.values - expected.attitude.values
    assert np.remainder(turned + 1.0, 2.0 * math.pi) == pytest.approx(1.0, abs=1e-9)
    assert found.wind.values == pytest.approx(expected.wind.values, abs=1e-9)
    assert np.sin(open_log(path).series["attitude"].values) == pytest.approx(np.sin(found.attitude.values))
    halved = {name: 0.5 * part for name, part in parts.items()}
    with pytest.raises(LogError, match=r"columns.quaternion_w: q\[0\] and the other parts have a length of 0.5"):
        read_motion(write_log(tmp_path / "quaternion", table, **halved))


def test_left_and_right_halves_are_one_aileron(tmp_path: Path) -> None:
    columns = circle()
    # A roll to the right: the left trailing edge down, and the right one up; both also droop by a degree.
    halves = {"left": columns["ail"] + 1.0, "right": -columns["ail"] + 1.0}
    table = TABLE.replace('aileron = { column = "ail", unit = "deg" }', "") + (
        '\n[columns.aileron_left]\ncolumn = "left"\nunit = "deg"\n'
        '[columns.aileron_right]\ncolumn = "right"\nunit = "deg"\n'
    )
    motion = read_motion(write_log(tmp_path, table, **halves))
    assert motion.controls.values[:, 1] == pytest.approx(np.radians(columns["ail"]))


def test_two_entries_hold_where_their_conditions_do(tmp_path: Path) -> None:
    columns = circle()
    auto = (columns["t"] > 100.0).astype(float)
    table = TABLE.replace('elevator = { column = "ele", unit = "deg" }', "") + (
        '\n[[columns.elevator]]\ncolumn = "ele"\nunit = "deg"\nwhen = { column = "auto", value = 1 }\n'
        '[[columns.elevator]]\ncolumn = "stick"\nunit = "deg"\noffset = 2.0\n'
    )
    motion = read_motion(write_log(tmp_path, table, auto=auto, stick=0.0 * auto - 9.0))
    elevator = -np.degrees(motion.controls.values[:, 0])
    assert elevator == pytest.approx(np.where(auto == 1.0, columns["ele"], -7.0))


def test_density_comes_from_pressure_and_temperature(tmp_path: Path) -> None:
    table = TABLE.replace('frame = "true"', 'frame = "indicated"') + (
        '\n[columns.static_pressure]\nvalue = 900.0\nunit = "hPa"\n[columns.temperature]\nvalue = 283.15\nunit = "K"\n'
    )
    motion = read_column_motion(write_log(tmp_path, table))
    density = 90_000.0 / (287.05 * 283.15)
    assert motion.ratio.values[:, 0] == pytest.approx(math.sqrt(1.225 / density))
    assert motion.airspeed.values[:, 0] == pytest.approx(AIRSPEED)


@pytest.fixture(scope="module")
def thor() -> Path:
    return THOR / "thor_flight75.columns.toml"


def test_the_flight_of_thor_is_read_as_it_is(thor: Path) -> None:
    motion = read_motion(thor)
    data = loadmat(THOR / "thor_flight75.mat", squeeze_me=True, struct_as_record=False)["flight_data"]
    assert motion.inertial.values[:, 3] == pytest.approx(data.p.astype(float))
    automatic = data.mode == 2
    assert motion.controls.values[automatic, 1] == pytest.approx(data.da_l[automatic].astype(float))
    # The sticks are at rest before the take-off.
    assert np.abs(np.median(motion.controls.values[:5000, :3], axis=0)).max() < 1e-3
    # 6.2 m/s, measured by others from the same triangle over 60 s.
    assert np.hypot(*np.median(motion.wind.values, axis=0)) == pytest.approx(6.2, abs=0.3)
    # The motor's log began 7.7 s after the aircraft's; without that shift this correlation is 0.66.
    throttle = np.interp(motion.battery.time, motion.controls.time, motion.controls.values[:, 3])
    assert np.corrcoef(throttle, motion.battery.values[:, 1])[0, 1] > 0.85
    # Measured by others on the original: 128 W in level flight.
    level = (np.abs(motion.velocity.values[:, 2]) < 0.7) & (np.abs(motion.attitude.values[:, 0]) < 0.1)
    air = motion.airspeed.values[:, 0] > 14.0
    power = np.interp(motion.inertial.time, motion.battery.time, motion.battery.values.prod(axis=1))
    assert np.median(power[level & air]) == pytest.approx(128.0, rel=0.05)
