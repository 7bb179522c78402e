"""Levels of a forecast, of one kind or of several kinds in one column."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from world.arrays import Floats

LevelKind = Literal["pressure", "height", "altitude"]


@dataclass(frozen=True, slots=True)
class LevelGroup:
    """Wind on levels of one kind.

    kind: "pressure", "height" (above ground) or "altitude".
    altitudes: (t, y, x, k) m: AMSL, or above ground for levels of the kind "height".
    velocities: (m, t, y, x, k, 2) m/s, east and north.
    """

    kind: LevelKind
    altitudes: Floats
    velocities: Floats


def merge_levels(groups: Sequence[LevelGroup], ground: Floats | None, ground_amsl: float) -> tuple[Floats, Floats]:
    """Return the altitudes (t, y, x, k) and the winds (m, t, y, x, k, 2) of all levels, in ascending order.

    A pressure level that is below the lowest level above ground is inside the ground. It gets the wind and the altitude
    of this lowest level.

    ground: (y, x) altitude of the ground in the forecast's model, m AMSL; None for the same altitude everywhere.
    ground_amsl: this single altitude, m AMSL.
    """
    ground_level = np.array(ground_amsl) if ground is None else ground
    altitudes, velocities = [], []
    members = max(len(group.velocities) for group in groups)
    for group in groups:
        above = ground_level[..., np.newaxis] if group.kind == "height" else 0.0
        altitudes.append(group.altitudes + above)
        velocities.append(np.broadcast_to(group.velocities, (members, *group.velocities.shape[1:])))
    all_altitudes, all_velocities = np.concatenate(altitudes, axis=-1), np.concatenate(velocities, axis=-2)
    surface = [k for k, group in enumerate(groups) if group.kind == "height"]
    if surface and len(groups) > len(surface):
        near_ground = np.concatenate([altitudes[k] for k in surface], axis=-1)
        lowest = near_ground.min(axis=-1, keepdims=True)
        index = np.argmin(near_ground, axis=-1)[..., np.newaxis]
        winds = np.concatenate([velocities[k] for k in surface], axis=-2)
        lowest_winds = np.take_along_axis(winds, np.broadcast_to(index, (members, *index.shape))[..., np.newaxis], -2)
        is_buried = all_altitudes < lowest
        all_altitudes = np.where(is_buried, lowest, all_altitudes)
        all_velocities = np.where(is_buried[..., np.newaxis], lowest_winds, all_velocities)
    order = np.argsort(all_altitudes, axis=-1, kind="stable")
    sorted_altitudes = np.take_along_axis(all_altitudes, order, axis=-1)
    all_orders = np.broadcast_to(order, (members, *order.shape))[..., np.newaxis]
    return sorted_altitudes, np.ascontiguousarray(np.take_along_axis(all_velocities, all_orders, axis=-2))
