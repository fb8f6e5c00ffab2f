"""A feeder as a Gymnasium environment: look at the parts, choose a stage, and be paid in picks per time.

    environment = feeder_sim.FeederEnvironment(feeder_sim.load_scenario("scenarios/separation_100.toml"))
    observation, _ = environment.reset(seed=0)
    observation, reward, terminated, truncated, info = environment.step(environment.action_space.sample())

Each step runs one stage of the schedule and picks what its pick allows, and with `pick` what that allows after any
stage. The reward of a step is its picks over its seconds on the clock of the robot: the stage, and the times of
`[robot]`. The sum of such rewards is not picks per time: a stage of 0.1 s with one pick earns more than one of 3 s with
twenty. With `reward="picks"` the picks themselves are the reward, and `info["seconds"]` says what they took.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, MissingExtra, NotAllowed, Unknown, check_whole
from feeder_sim.feeder.feeder import Feeder, checked_pick
from feeder_sim.feeder.poses import Poses
from feeder_sim.scenario import Pick, Robot, Scenario, Stage
from feeder_sim.scene.fits import check_pick
from feeder_sim.scene.scene import Scene

try:
    import gymnasium
except ImportError:
    raise MissingExtra("gym", key="FeederEnvironment") from None

Observation = dict[str, NDArray[Any]]
Reward = Literal["rate", "picks"]
MOST_STEPS = 100
HIGHEST = 1.0  # [m] over the plate, or the side of one that is larger; a part above it is shown there


class FeederEnvironment(gymnasium.Env[Observation, np.int64]):
    """A feeder behind Gymnasium's interface.

    An observation has a row for every part of the scenario, of which those count that are on the plate (`present`):
    `position` of the centre of mass [m] (parts, 3), `quaternion` with w first (parts, 4), `kind`, and `pose`, the
    number of the stable pose from 1 on, 0 in none (parts,). Bounds of positions are the sides of the plate.

    `info` has what the step picked, `seconds` that it took on the clock of the robot, simulated time and parts lost.

    An episode ends when no part is left on the plate, and is cut after `most_steps` stages.

    Args:
        scenario: as for `Feeder`; an action is the number of one of its stages.
        stages: as for `Feeder`.
        pick: allows picks after every stage, besides the picks of the stages; a `Pick`, or what makes one.
        most_steps: stages of an episode, from 1 on.
        reward: of a step: "rate", its picks per second on the clock of the robot, or "picks", their number.
        refill_below: with a [refill] in the scenario, parts are filled up to `refill.to` when fewer are on the plate;
            up to that number, 0 for never.

    Raises:
        InputError: as for `Feeder`, or an argument that is not allowed.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self,
        scenario: Scenario,
        *,
        stages: Sequence[Stage | Mapping[str, Any]] = (),
        pick: Pick | Mapping[str, Any] | None = None,
        most_steps: int = MOST_STEPS,
        reward: Reward = "rate",
        refill_below: int = 0,
    ) -> None:
        self._pick = None if pick is None else checked_pick(pick)
        self._most_steps = check_whole(most_steps, "most_steps")
        self._ready = self._feeder = Feeder(scenario, stages=stages)
        if reward not in get_args(Reward):
            raise Unknown(reward, get_args(Reward), key="reward")
        self._reward = reward
        self._refill_below = _checked_refill(scenario, refill_below)
        self._steps, self._over = 0, False
        scene = self._feeder.scene
        if self._pick is not None:
            check_pick(scene, self._pick, "pick")
        length, width = scene.surface.length, scene.surface.width
        self._reach = np.array([0.5 * length, 0.5 * width, max(HIGHEST, length, width)])
        n, poses = len(scene.parts), max((len(table.names) for table in scene.poses), default=0)
        self.action_space = gymnasium.spaces.Discrete(len(self._feeder.stage_names))
        self.observation_space: gymnasium.Space[Any] = gymnasium.spaces.Dict(
            {
                "present": gymnasium.spaces.MultiBinary(n),
                "position": _box(np.tile(self._reach, (n, 1))),
                "quaternion": _box(np.ones((n, 4))),
                "kind": gymnasium.spaces.MultiDiscrete([len(scene.kinds)] * n),
                "pose": gymnasium.spaces.MultiDiscrete([poses + 1] * n),
            }
        )

    @property
    def feeder(self) -> Feeder:
        """The feeder of the episode."""
        return self._feeder

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin anew with parts as the scenario starts them, drawn from the seed, or else from the random numbers."""
        super().reset(seed=seed)
        self._steps, self._over = 0, False
        self._feeder = self._ready.again(int(self.np_random.integers(2**31)) if seed is None else seed)
        return self._observe(self._feeder.poses()), self._info(0, 0.0)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run the stage of a number, pick, and fill in.

        Raises:
            InputError: there is no such stage, or the episode is over.
        """
        if self._over:
            raise InputError("comes after the end of an episode, must be `reset` first", key="step")
        if not self.action_space.contains(action):
            stages = len(self._feeder.stage_names)
            raise NotAllowed(action, f"a whole number from 0 to {stages - 1}", key="action")
        feeder, before = self._feeder, self._feeder.time
        self._steps += 1
        picked = len(feeder.vibrate(int(action)))
        if self._pick is not None:
            picked += len(feeder.pick_by(self._pick))
        robot = feeder.scene.scenario.robot or Robot()
        seconds = feeder.time - before + robot.camera_s + robot.pick_s * picked
        if len(feeder.poses()) < self._refill_below:
            scenario = feeder.scene.scenario
            feeder.refill(scenario.parts_at_once - len(feeder.poses()))
        poses = feeder.poses()
        reward = float(picked) if self._reward == "picks" else picked / seconds
        ended, cut = len(poses) == 0, self._steps >= self._most_steps
        self._over = ended or cut
        return self._observe(poses), reward, ended, cut, self._info(picked, seconds)

    def _info(self, picked: int, seconds: float) -> dict[str, Any]:
        feeder = self._feeder
        return {"time_s": feeder.time, "seconds": seconds, "picked": picked, "lost": len(feeder.lost)}

    def _observe(self, poses: Poses) -> Observation:
        scene: Scene = self._ready.scene
        n, part = len(scene.parts), poses.part
        is_on_plate, place, turn = np.zeros(n, np.int8), np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        is_on_plate[part], place[part], turn[part] = 1, poses.position, poses.quaternion
        lying = np.zeros(n, np.int64)
        for i, name in zip(part, poses.pose, strict=True):
            lying[i] = 0 if name is None else 1 + scene.poses[scene.kind_of[i]].names.index(name)
        return {
            "present": is_on_plate,
            "position": np.clip(place, -self._reach, self._reach),
            "quaternion": np.clip(turn, -1.0, 1.0),
            "kind": scene.kind_of.astype(np.int64),
            "pose": lying,
        }


def _checked_refill(scenario: Scenario, below: int) -> int:
    """Refuse a refill that the scenario does not have, or that could never be reached."""
    if check_whole(below, "refill_below", 0, scenario.parts_at_once) and scenario.refill is None:
        raise InputError(f"is {below}, must be 0 without a [refill] in the scenario", key="refill_below")
    return int(below)


def _box(reach: NDArray[np.float64]) -> gymnasium.spaces.Box:
    """Numbers up to a reach to both sides."""
    return gymnasium.spaces.Box(-reach, reach, dtype=np.float64)
