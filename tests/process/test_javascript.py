"""The kernel of a page's sliders, run by node: what the compiled kernel gives, to 1e-9."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.kernel.javascript import write_program
from tractexp.kernel.layout import PHASOR_INPUTS
from tractexp.model.drive import Drive, Excitation
from tractexp.model.lowering import lower
from tractexp.model.model import compose
from tractexp.testing.models import choose_active_size

NODE = shutil.which("node")
STEP, SUBSTEPS = 0.002, 2


def made(motor, static, effects=()):
    parts = [build("model/motor", {"name": motor}), build("model/static", {"name": static})]
    return compose(*parts, [build("effect", {"name": name}) for name in effects])


def dip():
    """A dip with edges, its frequency swinging."""
    t = np.arange(300) * STEP
    U = 1 - 0.35 * ((t > 0.15) & (t < 0.4))
    speed = 2 * np.sin(12 * t)
    flat = np.full(len(t), np.nan)
    return Excitation(STEP, U, flat, flat, float(U[0]), 0.9, 0.4, speed, float(speed[0]))


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.parametrize(
    ("motor", "static", "effects"),
    [
        ("electromechanical", "exponential", ()),
        ("electromechanical", "zip", ()),
        ("mechanical", "exponential_frequency", ()),
        ("voltage", "exponential", ()),
        ("none", "zip", ()),
        ("electromechanical", "exponential", ("stator_resistance",)),
        ("electromechanical", "exponential", ("second_cage", "undervoltage_trip")),
        ("electromechanical", "zip", ("thermostatic_load", "speed_dependent_torque")),
        ("double_cage", "zip", ("feeder_impedance",)),
    ],
)
def test_it_gives_what_the_compiled_kernel_gives(motor, static, effects, tmp_path):
    """With effects the steady state is solved for, here as there."""
    model, drive = made(motor, static, effects), Drive.from_events([dip()])
    own = {p.name for effect in model.effects for p in effect.parameters}
    values = np.array(
        [choose_active_size(p) if p.name in own else p.default for p in model.parameters]
    )
    expected = model.simulate(drive, values, SUBSTEPS)
    rows = dict(zip(PHASOR_INPUTS, np.nan_to_num(drive.inputs).tolist(), strict=True))
    given = json.dumps([*values.tolist(), *drive.before[0].tolist()])
    event = json.dumps(np.nan_to_num(drive.event[0]).tolist())
    call = f"simulate({given}, {event}, {json.dumps(rows)}, {SUBSTEPS})"
    program = tmp_path / "kernel.js"
    program.write_text(
        write_program(lower(model.equations), model.integration)
        + f"console.log(JSON.stringify({call}));"
    )
    done = subprocess.run([NODE, program], capture_output=True, text=True, check=True)
    P, Q = np.array(json.loads(done.stdout))
    assert pytest.approx(expected.P[0], abs=1e-9) == P
    assert pytest.approx(expected.Q[0], abs=1e-9) == Q
    assert np.ptp(P) > 0.1


@pytest.mark.skipif(NODE is None, reason="node is not installed")
def test_without_a_steady_state_there_is_none(tmp_path):
    model, drive = made("electromechanical", "exponential"), Drive.from_events([dip()])
    values = np.array([{"T_m": 9.0}.get(p.name, p.default) for p in model.parameters])
    assert model.refusal(values, drive)
    given = json.dumps([*values.tolist(), 0.9, 0.4])
    event = json.dumps(np.nan_to_num(drive.event[0]).tolist())
    program = tmp_path / "kernel.js"
    program.write_text(
        write_program(lower(model.equations), model.integration)
        + f"console.log(simulate({given}, {event}, {{U: [1]}}, 1));"
    )
    done = subprocess.run([NODE, program], capture_output=True, text=True, check=True)
    assert done.stdout == "null\n"


def test_a_model_in_waveforms_has_no_sliders():
    parts = [build("model/motor", {"name": "stator_flux"}), build("model/static", {"name": "zip"})]
    model = compose(*parts, domain="waves")
    with pytest.raises(UserError, match="this one is in waveforms"):
        write_program(lower(model.equations), model.integration)
