"""What is known of a robot, as a value: the table and the JSON of the command, and the numbers of the robot."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError

import pytest

import robot_dyn as rd
from tests.command import document, said


@pytest.mark.parametrize("name", ["panda", "mimic_chain", "pendulum"])
def test_the_value_is_what_the_command_prints(name: str) -> None:
    answer = rd.info(rd.load(name))
    assert said("info", name) == f"{answer}\n"
    assert document("info", name) == json.loads(answer.to_json())


def test_it_has_the_numbers_of_the_robot_and_does_not_change() -> None:
    arm = rd.load("ur5").with_(payload=rd.Payload("tool0", 2.5), lock={"elbow_joint": 0.25})
    answer = rd.info(arm)
    assert (answer.n, answer.total_mass, answer.locked) == (5, arm.total_mass, {"elbow_joint": 0.25})
    assert answer.links == arm.frame_names
    for name in ("lower", "upper", "effort_limit", "velocity_limit", "damping", "friction", "armature"):
        assert [getattr(joint, name) for joint in answer.joints] == getattr(arm, name).tolist()
    assert "payload: 2.5 kg on tool0" in repr(answer)
    with pytest.raises(FrozenInstanceError):
        answer.n = 3  # pyright: ignore[reportAttributeAccessIssue]
