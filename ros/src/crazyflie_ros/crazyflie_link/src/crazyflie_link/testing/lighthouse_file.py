"""Files of lighthouse base stations."""

from pathlib import Path

from cflib.crazyflie.mem import LighthouseBsCalibration, LighthouseBsGeometry
from cflib.localization import LighthouseConfigFileManager


def write_lighthouse_file(path: Path, *numbers: int, system_type: int = 2) -> str:
    """Write the base stations of these numbers as cflib does, and return the path.

    Station k is at (1, 2, 2 + k), m; its calibration has the identifier 1000 + k.
    """
    geometries, calibrations = {}, {}
    for number in numbers:
        geometry, calibration = LighthouseBsGeometry(), LighthouseBsCalibration()
        geometry.origin, geometry.valid = [1.0, 2.0, 2.0 + number], True
        calibration.uid, calibration.valid = 1000 + number, True
        geometries[number], calibrations[number] = geometry, calibration
    LighthouseConfigFileManager.write(str(path), geometries, calibrations, system_type)
    return str(path)
