"""Geometry and calibration of lighthouse base stations."""

import struct
from collections.abc import Mapping
from typing import Any

from cflib.crazyflie.localization import Localization
from cflib.crazyflie.mem import (
    LighthouseBsCalibration,
    LighthouseBsGeometry,
    LighthouseMemory,
    MemoryElement,
)
from cflib.crtp.crtpstack import CRTPPort
from cflib.localization import LighthouseConfigFileManager

from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_link.parameters import FirmwareParameters
from crazyflie_link.subsystem import Subsystem, find_memory, write_memory
from crazyflie_link.transmission import Request

STATIONS = 16  #: The most that the firmware can be built for.

_TYPE = "lighthouse.systemType"
_STORE = bytes([Localization.LH_PERSIST_DATA])

_FLASH_LIMIT = 3.0  #: Time limit of storing, s: the vehicle may tidy its flash memory up.


class Lighthouse(Subsystem):
    """The vehicle's memory of base stations."""

    def write_file(self, path: str, parameters: FirmwareParameters) -> int:
        """Write a configuration as cfclient writes it, and store it; blocks.

        The data of all other stations become invalid. Returns the number of stations in the file.
        Raises `ValueRangeError` about the file, `CrazyflieError` if the vehicle does not take it.
        """
        try:
            geometries, calibrations, system_type = LighthouseConfigFileManager.read(path)
            numbers = {*geometries, *calibrations}
            unknown = [number for number in numbers if number not in range(STATIONS)]
        except Exception as error:
            # cflib raises bare exceptions, and whatever a strange file leads to.
            reason = " ".join(str(error).split())
            raise ValueRangeError(
                f"lighthouse file {path}: {reason}; expected a lighthouse_system_configuration, as "
                "cfclient and cflib write it"
            ) from None
        if unknown:
            raise ValueRangeError(
                f"lighthouse file {path}: base station {unknown[0]!r}; expected 0 to {STATIONS - 1}"
            )
        if parameters.values().get(_TYPE) != system_type:
            # It forgets all stations.
            parameters.write(_TYPE, system_type)
        first, calibration_first = (
            LighthouseMemory.GEO_START_ADDR,
            LighthouseMemory.CALIB_START_ADDR,
        )
        geometry_mask = self._write_all(geometries, LighthouseBsGeometry(), first)
        calibration_mask = self._write_all(
            calibrations, LighthouseBsCalibration(), calibration_first
        )
        self._store(geometry_mask, calibration_mask)
        return len(numbers)

    def _write_all(self, given: Mapping[int, Any], none: Any, first: int) -> int:
        # Returns the mask of the stations that the vehicle has room for.
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_LH, "base stations")
        mask = 0
        for number in range(STATIONS):
            data = bytearray()
            given.get(number, none).add_mem_data(data)
            address = first + number * LighthouseMemory.PAGE_SIZE
            try:
                write_memory(link, memory.id, address, bytes(data), f"base station {number}")
                mask |= 1 << number
            except RefusedError:
                if any(other >= number for other in given):
                    raise
                # The firmware is built for fewer.
                break
        return mask

    def _store(self, geometries, calibrations):
        port, channel = CRTPPort.LOCALIZATION, Localization.GENERIC_CH
        what = "storing the base stations"
        request = Request(port, channel, _STORE, what, limit=_FLASH_LIMIT)
        answer = self._current_link().request(
            _STORE + struct.pack("<HH", geometries, calibrations), request
        )
        if len(answer) < 2 or not answer[1]:
            raise RefusedError(f"{what}: the vehicle refuses it")
