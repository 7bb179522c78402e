"""A model becomes registers and instructions, and one that is not covered is refused with the reason."""

import math
from pathlib import Path

import jsbsim
import numpy as np
import pytest

from aircraft.catalog import aircraft_names, load_aircraft
from flight.dynamics.compiled_frame import FRAME_NUMBERS
from flight.dynamics.fdm import load_model
from flight.dynamics.instructions import Operation, run_instructions
from flight.dynamics.model_program import (
    _JSBSIM_AERO_PROPERTIES,
    _JSBSIM_ROOTS,
    ModelProgram,
    UnsupportedModel,
    frame_register,
    translate,
)

ALPHA = frame_register("alpha")
VARIABLE = "<independentVar lookup='row'> aero/alpha-rad </independentVar>"


def model(function: str = "<v> 1 </v>", *, fcs: str = "", aero: str = "", external: str = "", more: str = "") -> bytes:
    """A model with a function of its aerodynamics, and other parts."""
    return f"""<fdm_config><ground_reactions/><propulsion/>{more}
<flight_control><property value="0">command/a</property><channel name="c">{fcs}</channel></flight_control>
<aerodynamics><function name="f">{function}</function>{aero}
<axis name="X" frame="STABILITY"><function name="x"><p>f</p></function></axis></aerodynamics>
<external_reactions>{external}</external_reactions></fdm_config>""".encode()


def _computed(name: str) -> str:
    """Return a component that computes a property."""
    return f"<fcs_function name='{name}'><function><v>1</v></function></fcs_function>"


def instructions(code: tuple[int, ...]) -> list[tuple[int, int, tuple[int, ...]]]:
    """Operation, target and operands of each instruction."""
    found, at = [], 0
    while at < len(code):
        operation, target, count = code[at : at + 3]
        found.append((operation, target, code[at + 3 : at + 3 + count]))
        at += 3 + count
    return found


def of_function(function: str) -> tuple[ModelProgram, list[tuple[int, int, tuple[int, ...]]]]:
    """Instructions of a function, whose value is in the register of the property f."""
    program = translate(model(function))
    # Its own axis and the sums of all axes follow.
    return program, instructions(program.aero)[:-7]


def test_a_function_is_evaluated_inside_out_into_its_property() -> None:
    program, found = of_function("<sum> <v> 2 </v> <product> <p> aero/alpha-rad </p> <v> 3 </v> </product> </sum>")
    (first, inside, (alpha, three)), (second, target, (two, inner)) = found
    assert (first, second) == (Operation.PRODUCT, Operation.SUM)
    assert (alpha, inner, target) == (ALPHA, inside, program.properties["f"])
    assert (program.numbers[two], program.numbers[three]) == (2.0, 3.0)


def test_a_minus_sign_before_a_property_changes_its_sign() -> None:
    program, ((operation, negative, (alpha, factor)), (_, target, operands)) = of_function("<p> -aero/alpha-rad </p>")
    assert (operation, alpha, program.numbers[factor]) == (Operation.PRODUCT, ALPHA, -1.0)
    assert (operands, target) == ((negative,), program.properties["f"])


def test_a_table_keeps_its_rows() -> None:
    table = f"<table>{VARIABLE}<tableData> 0 5\n 1 7\n 3 6 </tableData></table>"
    program, ((operation, _, (key, begin, rows)),) = of_function(table)
    assert (operation, key, rows) == (Operation.TABLE, ALPHA, 3)
    assert program.numbers[begin : begin + 6] == (0.0, 5.0, 1.0, 7.0, 3.0, 6.0)


def test_one_number_has_one_register_and_zeros_of_two_signs_have_two() -> None:
    program, ((_, _, operands),) = of_function("<sum> <v> 0 </v> <v> 1 </v> <v> 1.0 </v> <v> -0 </v> </sum>")
    assert operands[1] == operands[2]
    assert (str(program.numbers[operands[0]]), str(program.numbers[operands[3]])) == ("0.0", "-0.0")


def test_axes_are_summed_in_jsbsims_order() -> None:
    roll = '<axis name="ROLL"><function> <v> 1 </v> </function><function> <v> 2 </v> </function></axis>'
    program = translate(model(aero=roll))
    sums = {
        target: operands for operation, target, operands in instructions(program.aero) if operation == Operation.SUM
    }
    assert sorted(sums) == list(range(frame_register("aero_force"), frame_register("aero_force") + 6))
    assert [program.numbers[one] for one in sums[frame_register("aero_moment")]] == [1.0, 2.0]
    assert [program.numbers[one] for one in sums[frame_register("aero_moment", 2)]] == [0.0]


def test_an_actuator_has_its_memory_and_its_limits() -> None:
    actuator = """<actuator name="surface/a"><input> command/a </input><lag> 20 </lag>
<rate_limit> 3 </rate_limit><clipto><min> -0.5 </min><max> 0.4 </max></clipto></actuator>"""
    program = translate(model(fcs=actuator))
    ((operation, target, (source, begin)),) = instructions(program.fcs)
    assert (operation, target) == (Operation.ACTUATOR, program.properties["surface/a"])
    assert program.actuators == ((begin, source, 20.0, 3.0),)
    assert program.numbers[begin + 6 : begin + 8] == (-0.5, 0.4)


def test_all_numbers_of_the_frame_come_first() -> None:
    assert translate(model()).numbers[:FRAME_NUMBERS] == (0.0,) * FRAME_NUMBERS


def test_all_aircraft_but_one_are_covered() -> None:
    refused = []
    for name in aircraft_names():
        try:
            translate(load_aircraft(name).model_file.read_bytes())
        except UnsupportedModel:
            refused.append(name)
    assert refused == ["c172x"]


def test_the_properties_of_jsbsims_own_are_those_of_its_catalog(tmp_path: Path) -> None:
    """They are all properties of an instance with a model that the model does not name."""
    aircraft = load_aircraft("aerosonde")
    jsbsim.FGJSBBase().debug_lvl = 0
    instance = jsbsim.FGFDMExec(str(tmp_path))
    load_model(instance, tmp_path, aircraft, 1 / 120, str, flat_earth=False, is_tested=True)
    catalog = {line.partition(" ")[0] for line in instance.query_property_catalog("").splitlines()}
    assert "atmosphere/delta-T" in catalog
    text = aircraft.model_file.read_text()
    of_actuators = ("/malfunction/", "/saturated")
    own = {name for name in catalog if name and name not in text and not any(part in name for part in of_actuators)}
    assert {name.partition("/")[0] for name in own} <= {*_JSBSIM_ROOTS, "aero", "fcs"}
    assert {name.partition("/")[2] for name in own if name.startswith("aero/")} <= _JSBSIM_AERO_PROPERTIES


@pytest.mark.parametrize(
    ("operation", "operands", "value"),
    [
        ("max", (math.nan, 1.0), 1.0),
        ("max", (1.0, math.nan), 1.0),
        ("min", (math.nan, 1.0), 1.0),
        ("min", (2.0, math.nan, 1.0), 1.0),
        ("max", (math.nan, math.nan), -math.inf),
        ("min", (-3.0, 4.0), -3.0),
    ],
)
def test_extremes_ignore_what_is_not_a_number_as_jsbsim_does(
    operation: str, operands: tuple[float, ...], value: float
) -> None:
    """JSBSim compares each operand with the extreme so far, from -infinity or +infinity on (FGFunction, 1.3.3)."""
    places = [11.0 + k for k in range(len(operands))]
    program, _ = of_function(f"<{operation}>{''.join(f'<v> {place} </v>' for place in places)}</{operation}>")
    numbers = np.array(program.numbers)
    for place, operand in zip(places, operands, strict=True):
        numbers[program.numbers.index(place)] = operand
    code = np.array(program.aero, dtype=np.uint32)
    run_instructions(numbers, code, 0, 3 + len(operands))
    assert numbers[program.properties["f"]] == value


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        (model("<sinh> <v> 1 </v> </sinh>"), "<sinh>"),
        (model("<sum> <v> 1 </v> <random/> </sum>"), "<random> in <sum>"),
        (model("<quotient> <v> 1 </v> </quotient>"), "<quotient> of 1 operands"),
        (model("<p> aero/mag-beta-rad </p>"), "property aero/mag-beta-rad"),
        (model("<p apply='t'> aero/alpha-rad </p>"), "<p apply=...>"),
        (model("<v> 1 </v> <v> 2 </v>"), "<function> of 2 values"),
        (model("<v> one </v>"), "'one' instead of a number in <v>"),
        (model(f"<table>{VARIABLE}<tableData> 0 1 1 x </tableData></table>"), "'x' instead of a number in <tableData>"),
        (model(f"<table>{VARIABLE}<tableData> 1 1 0 2 </tableData></table>"), "growing keys"),
        (model(f"<table>{VARIABLE}{VARIABLE}<tableData> 1 1 0 2 </tableData></table>"), "more than one variable"),
        (b"<fdm_config>", "XML with an error"),
        (model(more="<output/>"), "the section <output>"),
        (model(more="<system file='a'/>"), "the section <system>"),
        (model().replace(b"<propulsion/>", b"<propulsion><tank/></propulsion>"), "<tank> in <propulsion>"),
        (
            model().replace(b"<ground_reactions/>", b"<ground_reactions><contact/></ground_reactions>"),
            "<contact type=''>",
        ),
        (model().replace(b'"STABILITY"', b'"WIND"'), "<axis name='X'> in the frame WIND"),
        (model(aero="<axis name='LIFT'/>"), "<axis name='LIFT'>"),
        (model(fcs="<pid name='a/b'/>"), "<pid> in <channel>"),
        (
            model(fcs="<actuator name='a/b'><input>command/a</input><hysteresis_width>1</hysteresis_width></actuator>"),
            "hysteresis",
        ),
        (model(fcs="<actuator name='a/b'><input>command/a</input><lag>command/a</lag></actuator>"), "'command/a'"),
        (model(fcs=_computed("forces/hold-down")), "computes forces/hold-down, which JSBSim uses itself"),
        (model(fcs=_computed("inertia/pointmass-weight-lbs")), "computes inertia/pointmass-weight-lbs"),
        (model(fcs=_computed("external_reactions/t/x")), "computes external_reactions/t/x"),
        (model(fcs=_computed("a/b/malfunction/fail_zero")), "computes a/b/malfunction/fail_zero"),
        (model(fcs=_computed("aero/alpha-max-rad")), "computes aero/alpha-max-rad"),
        (model(aero="<function name='atmosphere/delta-T'><v>1</v></function>"), "computes atmosphere/delta-T"),
        (model(external="<force name='t' frame='LOCAL'><function><v>1</v></function></force>"), "BODY"),
    ],
)
def test_what_is_not_covered_is_named(changed: bytes, reason: str) -> None:
    with pytest.raises(UnsupportedModel) as refused:
        translate(changed)
    assert reason in str(refused.value)
