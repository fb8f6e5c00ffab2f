"""Constants of physics."""

from __future__ import annotations

GRAVITY = 9.81  # [m/s^2]
