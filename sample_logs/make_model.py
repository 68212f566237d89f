"""Make models/rrr.json, the full example of a model file: python -m sample_logs.make_model

The arm is the one of robots/rrr.toml, its base parameters those of its (synthetic) links by Kostić
et al. 2004, eq. (A4); its friction is a synthetic three-sigmoid friction, eq. (10). Nothing was
fitted: every origin is "known", every std null, and the range of validity that of the joint limits,
for it is fitted to no log.
"""

from __future__ import annotations

from pathlib import Path

from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.friction import ThreeSigmoid
from pipelines.io.model_file import Validity, model_text
from pipelines.io.robot_files import load_robot

HERE = Path(__file__).parent

# (f1, f2, f3 [N m]; w1, w2, w3 [s/rad]; b [N m s/rad]) in the order w1 > w2 > w3. Coulomb
# friction is about 8 % of the nominal torque, with a dip at low speed.
FRICTION = (  # numerics
    ((1.5, 4.8, -1.5), (120.0, 60.0, 12.0), 0.60),
    ((0.8, 2.4, -0.8), (120.0, 60.0, 12.0), 0.30),
    ((0.4, 1.2, -0.4), (120.0, 60.0, 12.0), 0.12),
)


def synthetic_arm() -> Arm:
    """Return the RRR arm with the synthetic links and friction."""
    arm = Arm.from_links(load_robot("rrr"))
    laws = []
    for joint, (f, w, b) in enumerate(FRICTION, start=1):
        heights = {f"f{k}": value for k, value in enumerate(f, start=1)}
        sharpnesses = {f"w{k}": value for k, value in enumerate(w, start=1)}
        values = heights | sharpnesses | {"b": b}
        laws.append(Acting.of(ThreeSigmoid(joint), values, origin="known"))
    return Arm("rrr-synthetic", arm.body, arm.base, tuple(laws))


def example_text() -> str:
    """Return the text of models/rrr.json."""
    robot = load_robot("rrr")
    speed = tuple((-joint.velocity, joint.velocity) for joint in robot.joints)
    acceleration = tuple((-joint.acceleration, joint.acceleration) for joint in robot.joints)
    validity = Validity(speed=speed, acceleration=acceleration, posture=(None, None, None))
    notes = (
        "Synthetic: links and friction were made up to agree with what the paper prints.",
        "No log stands behind this model: its range is that of the joint limits.",
    )
    return model_text(synthetic_arm().to_model(validity=validity, notes=notes))


if __name__ == "__main__":
    (HERE / "models").mkdir(exist_ok=True)
    (HERE / "models" / "rrr.json").write_text(example_text(), encoding="utf-8")
