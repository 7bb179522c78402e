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
    """Merge levels of several kinds into one column, in ascending order of altitude.

    ground: altitude of the ground in the forecast's model, (y, x) m AMSL; None for ``ground_amsl`` everywhere.
    ground_amsl: altitude of the ground if the model's ground is unknown, m AMSL.

    Returns the altitudes (t, y, x, k), m AMSL, and the winds (m, t, y, x, k, 2), m/s. A pressure or altitude level
    below the lowest level above ground is inside the ground. It gets the wind and the altitude of this lowest level.
    """
    ground_level = np.array(ground_amsl) if ground is None else ground
    altitudes, velocities = [], []
    members = max(len(group.velocities) for group in groups)
    for group in groups:
        reference_altitude = ground_level[..., np.newaxis] if group.kind == "height" else 0.0
        altitudes.append(group.altitudes + reference_altitude)
        velocities.append(np.broadcast_to(group.velocities, (members, *group.velocities.shape[1:])))
    all_altitudes, all_velocities = np.concatenate(altitudes, axis=-1), np.concatenate(velocities, axis=-2)
    height_groups = [k for k, group in enumerate(groups) if group.kind == "height"]
    if height_groups and len(groups) > len(height_groups):
        level_altitudes = np.concatenate([altitudes[k] for k in height_groups], axis=-1)
        lowest_altitude = level_altitudes.min(axis=-1, keepdims=True)
        index = np.argmin(level_altitudes, axis=-1)[..., np.newaxis]
        winds = np.concatenate([velocities[k] for k in height_groups], axis=-2)
        lowest_winds = np.take_along_axis(winds, np.broadcast_to(index, (members, *index.shape))[..., np.newaxis], -2)
        is_buried = all_altitudes < lowest_altitude
        all_altitudes = np.where(is_buried, lowest_altitude, all_altitudes)
        all_velocities = np.where(is_buried[..., np.newaxis], lowest_winds, all_velocities)
    order = np.argsort(all_altitudes, axis=-1, kind="stable")
    sorted_altitudes = np.take_along_axis(all_altitudes, order, axis=-1)
    all_orders = np.broadcast_to(order, (members, *order.shape))[..., np.newaxis]
    return sorted_altitudes, np.ascontiguousarray(np.take_along_axis(all_velocities, all_orders, axis=-2))
