"""Settings of collision avoidance as parameters of the firmware."""

from crazyflie_model.collision_avoidance import AvoidanceSettings

#: In place of an infinite corner, m: the parameter server has no infinity.
_FIRMWARE_INFINITY = 1e9


def avoidance_parameters(settings: AvoidanceSettings) -> dict[str, float]:
    """Return the firmware parameters of collision avoidance.

    Names are those of bitcraze/crazyflie-firmware, collision_avoidance.c.
    """
    values: dict[str, float] = {
        "colAv.horizon": settings.horizon,
        "colAv.maxSpeed": settings.max_speed,
        "colAv.sidestepThrsh": settings.sidestep_threshold,
        "colAv.vorTol": settings.tolerance,
        "colAv.vorIters": settings.max_iterations,
    }
    for axis, radius, low, high in zip(
        "XYZ", settings.radii, settings.box_min, settings.box_max, strict=True
    ):
        values[f"colAv.ellipsoid{axis}"] = radius
        values[f"colAv.bboxMin{axis}"] = max(low, -_FIRMWARE_INFINITY)
        values[f"colAv.bboxMax{axis}"] = min(high, _FIRMWARE_INFINITY)
    return values
