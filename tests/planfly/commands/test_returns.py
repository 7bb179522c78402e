"""``planfly returns``: a mission flown, and its log; what it prints, answers and ends with; bad input."""

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

import planfly
from planfly.cli import main
from tests.autopilots import write_fake
from tests.logs.verdict.returns.hill import SCENARIO, mission_text
from tests.own_aircraft import change_model


@pytest.fixture
def hill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "hill.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "hill.waypoints").write_text(mission_text(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The log of the mission over the hill, flown once."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "hill.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "hill.waypoints").write_text(mission_text(), encoding="utf-8")
    flown = ["fly", str(folder / "hill.waypoints"), "--scenario", str(folder / "hill.toml")]
    with redirect_stdout(StringIO()) as out:
        # The return after the last item hits the hill.
        assert main([*flown, "--log", str(folder / "hill.mcap")]) == 4
    assert "\nreturns   " in out.getvalue()
    return (folder / "hill.mcap").read_bytes()


def test_a_mission_and_its_log_say_the_same(hill: Path, log: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    (hill / "hill.mcap").write_bytes(log)
    asked = ["returns", "hill.waypoints", "--scenario", "hill.toml", "--every", "20", "--json", "mission.json"]
    assert main(asked) == 4
    out = capsys.readouterr().out
    assert "1 of 13 returns hits the ground, 1 descends below 30 m above ground; 11 are safe" in out
    assert out.splitlines()[1].startswith("  Aircraft: aerosonde, 11 kg, ")
    assert "causes of a return: the pilot's RTL, the mission's end" in out
    assert "no return after RC lost (FS_LONG_ACTN 0), station lost (FS_GCS_ENABL 0), battery low" in out
    assert "also flown in JSBSim" in out
    answer = json.loads((hill / "mission.json").read_text(encoding="utf-8"))
    assert answer["conditions"]["aircraft"] == "aerosonde"
    assert answer["ranges"][0]["kind"] == "ground"
    assert "engine out: home can be reached from" in out
    assert "point of no return by energy: none, because every return that arrives leaves the reserve of" in out
    assert "; 1 return that does not arrive is left out" in out
    assert "which contains no trees, houses or water" in out
    glides = answer["engine_out"]
    assert sum(glides[kind] for kind in ("home", "site", "flat", "nothing", "unknown")) == 13
    assert sum(one["count"] for one in glides["ranges"]) == 13
    assert glides["sites"][0]["kind"] == "home"
    assert (glides["not_judged"], glides["airspeed_mps"], glides["margin_m"]) == ("", 18.0, 30.0)
    # 500 m over the ground glide for 5 km: home from the first, flat ground alone from the last.
    assert (glides["ranges"][0]["reach"], glides["ranges"][-1]["reach"]) == ("home", "flat")
    assert glides["ranges"][0]["own"] == "arrives"
    assert (answer["no_return"], answer["no_return_s"]) == ("never", None)
    assert main(["returns", "hill.mcap", "--every", "20", "--json", "log.json", "--quiet"]) == 4
    of_log = json.loads((hill / "log.json").read_text(encoding="utf-8"))
    assert of_log["headline"] == answer["headline"]
    assert of_log["engine_out"] == answer["engine_out"]
    assert main(["check", "hill.waypoints", "--scenario", "hill.toml"]) == 4
    assert "\nreturns   " in capsys.readouterr().out


@pytest.mark.usefixtures("blank_pictures")
def test_pictures_map_and_log_go_into_a_folder(hill: Path, log: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    (hill / "hill.mcap").write_bytes(log)
    asked = ["returns", "hill.mcap", "--every", "20", "--out", "drawn"]
    assert main([*asked, "--json", "answer.json"]) == 4
    capsys.readouterr()
    files = sorted(path.name for path in (hill / "drawn").iterdir())
    pictures = ["glide.png", "return-heights.png", "returns.png", "worst-returns.png"]
    assert files == sorted([*pictures, "returns.kml", "returns.mcap"])
    answer = json.loads((hill / "answer.json").read_text(encoding="utf-8"))
    assert sorted(Path(name).name for name in answer["files"]) == files
    # A whole flight, with its returns in the scene.
    assert main(["check", "drawn/returns.mcap"]) == 4
    assert main([*asked, "--quiet"]) == 2
    assert "exists and is not empty" in capsys.readouterr().err
    # The report and an exported map of the flight have them too.
    assert main(["report", "hill.mcap", "--out", "page", "--quiet"]) == 4
    page = (hill / "page" / "report.html").read_text(encoding="utf-8")
    for name in ("returns", "worst-returns", "return-heights", "glide"):
        assert f'<section id="{name}">' in page
        assert f'data-chart="{name}"' in page
    assert main(["export", "hill.mcap", "hill.kml", "hill.gpx"]) == 0
    assert "plan and flown and returns" in capsys.readouterr().out
    assert "a return hits the ground" in (hill / "hill.kml").read_text(encoding="utf-8")
    assert "a return" not in (hill / "hill.gpx").read_text(encoding="utf-8")


def test_without_terrain_nothing_is_known(hill: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["returns", "hill.waypoints", "--every", "50"]) == 3
    out = capsys.readouterr().out
    assert "fly where the terrain is unknown" in out
    assert "name an elevation file with --terrain" in out
    assert "engine out: not judged: there is no elevation file" in out


def test_an_aircraft_in_a_folder_returns_too(hill: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_model(hill, "aerosonde", "own")
    asked = ["hill.waypoints", "--scenario", "hill.toml", "--aircraft", "./own"]
    assert main(["returns", *asked, "--every", "50"]) in (0, 4)
    assert "causes of a return: the pilot's RTL" in capsys.readouterr().out
    assert main(["check", *asked]) == 4
    assert "Aircraft: own, 11 kg" in capsys.readouterr().out


def test_parameters_make_it_safe(hill: Path) -> None:
    (hill / "mine.parm").write_text("RTL_ALTITUDE 600\nFS_LONG_ACTN 1\nROLL_LIMIT_DEG 30\n", encoding="utf-8")
    found = planfly.returns("hill.waypoints", scenario="hill.toml", params="mine.parm", every=20)
    assert found.safe
    assert any(cause.name == "RC lost" and cause.is_return for cause in found.returns.causes)


def test_returns_that_follow_the_terrain_end_with_3(hill: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (hill / "mine.parm").write_text("RTL_ALTITUDE 600\nTERRAIN_FOLLOW 1\n", encoding="utf-8")
    asked = ["returns", "hill.waypoints", "--scenario", "hill.toml", "--every", "40", "--params", "mine.parm"]
    assert main([*asked, "--suggest"]) == 3
    out = capsys.readouterr().out
    assert out.startswith("returns   not judged: with TERRAIN_FOLLOW returns follow the terrain")
    assert "safe" not in out
    assert "ArduPlane's own return, which would follow the terrain, is not simulated" in out


# Names and words of ArduPlane that no answer for PX4 has.
ARDUPLANES = ("ArduPlane", "RTL_ALTITUDE", "RTL_AUTOLAND", "RTL_CLIMB_MIN", "RALLY_", "FS_LONG", " AIRSPEED_MIN")


@pytest.fixture
def behind(hill: Path) -> Path:
    """A mission behind the hill, below its top, to which PX4 has to return over the hill."""
    (hill / "behind.waypoints").write_text(mission_text(5000.0, 6500.0, amsl=200.0), encoding="utf-8")
    for height in (100, 400, 450):
        text = f"# Stack: PX4 Pro\nRTL_RETURN_ALT {height}\nRTL_DESCEND_ALT 100\n"
        (hill / f"rtl{height}.params").write_text(text, encoding="utf-8")
    return hill


def test_px4_returns_by_its_own_parameters(behind: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["returns", "behind.waypoints", "--scenario", "hill.toml", "--every", "20", "--suggest", "--params"]
    answers = {}
    for height, code in ((100, 4), (450, 0)):
        assert main([*asked, f"rtl{height}.params", "--json", f"{height}.json"]) == code
        out = capsys.readouterr().out
        assert not any(name in out for name in ARDUPLANES)
        assert "causes of a return: the pilot's RTL, RC lost (NAV_RCL_ACT 2)" in out
        assert f"An aircraft below RTL_RETURN_ALT ({height} m above the destination) first climbs to this height" in out
        assert "returns are simulated in the mean wind, with a point-mass model under PX4's control laws" in out
        assert "PX4's own return without the engine is not simulated" in out
        assert ("would help: RTL_RETURN_ALT 4" in out) is (height == 100)
        answers[height] = json.loads((behind / f"{height}.json").read_text(encoding="utf-8"))
    low, high = answers[100], answers[450]
    assert (low["ranges"][0]["kind"], high["ranges"][0]["kind"]) == ("ground", "safe")
    assert (high["safe"], high["not_judged"], high["rtl_autoland"]) == (True, [], None)
    assert {one["own"] for one in high["engine_out"]["ranges"]} == {"not flown"}
    # 11 kg need at least 10.5 Wh to be lifted by 350 m.
    energy_wh = {one: max(each["energy_wh"] for each in answer["ranges"]) for one, answer in answers.items()}
    assert energy_wh[450] - energy_wh[100] > 10.0


def test_returns_of_px4_along_the_mission_end_with_3(behind: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (behind / "along.params").write_text("RTL_TYPE 2\nRTL_RETURN_ALT 450\nNAV_ACC_RAD 30\n", encoding="utf-8")
    asked = ["returns", "behind.waypoints", "--scenario", "hill.toml", "--every", "20", "--autopilot", "px4"]
    assert main([*asked, "--params", "along.params", "--suggest"]) == 3
    out = capsys.readouterr().out
    assert out.startswith("returns   not judged: RTL_TYPE 2 returns along the mission, which is not simulated")
    assert not any(name in out for name in ARDUPLANES)


def test_a_verdict_of_px4_agrees_with_itself_on_the_return(behind: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its return as an item of the mission, and the line of its returns from everywhere, are by the same law."""
    (behind / "back.waypoints").write_text(mission_text(5000.0, 6500.0, amsl=200.0, back=True), encoding="utf-8")
    asked = ["fly", "back.waypoints", "--scenario", "hill.toml", "--params", "rtl450.params"]
    main(asked)
    out = capsys.readouterr().out
    assert "  return           1 of 1 ok" in out
    assert "climbing 250 m first, to 450 m AMSL, and descending 350 m in a loiter there, to 100 m AMSL" in out
    assert "returns   all " in out
    assert "not simulated" not in out.partition("returns   all ")[2]


def test_arduplanes_program_does_not_fly_returns_of_px4(behind: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["returns", "behind.waypoints", "--scenario", "hill.toml", "--params", "rtl450.params"]
    assert main([*asked, "--sitl", str(write_fake(behind))]) == 2
    assert "the program of ArduPlane cannot check the returns of PX4" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.waypoints"], "none.waypoints"),
        (["hill.waypoints", "--flight", "2"], "allowed only with the log of another program, such as .BIN"),
        (["homeless.plan"], "home: missing"),
    ],
)
def test_bad_input_is_one_line(hill: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    items = [
        {
            "type": "SimpleItem",
            "command": 16,
            "frame": 0,
            "autoContinue": True,
            "doJumpId": k,
            "params": [0, 0, 0, None, 46.0, 8.0 + 0.02 * k, 600],
        }
        for k in (1, 2)
    ]
    plan = {"fileType": "Plan", "version": 1, "groundStation": "x", "mission": {"version": 2, "items": items}}
    (hill / "homeless.plan").write_text(json.dumps(plan), encoding="utf-8")
    assert main(["returns", *words, "--scenario", "hill.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert len(captured.err.strip().splitlines()) == 1


def test_seconds_out_of_range_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["returns", "hill.waypoints", "--every", "0"])
    assert ended.value.code == 2
    assert "expected a time from 0.1 to 3,600 s" in capsys.readouterr().err
    with pytest.raises(planfly.ArgumentError, match="every 4000"):
        planfly.returns("hill.waypoints", every=4000)
