"""Lighthouse base stations: geometry and calibration in the vehicle, angles that it measures."""

import queue
import struct
from collections.abc import Callable, Mapping
from typing import Any

from cflib.crazyflie.localization import Localization
from cflib.crazyflie.mem import (
    LighthouseBsCalibration,
    LighthouseBsGeometry,
    LighthouseMemHelper,
    LighthouseMemory,
    MemoryElement,
)
from cflib.crtp.crtpstack import CRTPPort
from cflib.localization import LighthouseConfigFileManager, LighthouseSweepAngleAverageReader
from cflib.localization.lighthouse_bs_vector import LighthouseBsVectors

from crazyflie_link.errors import NoReplyError, RefusedError, ValueRangeError
from crazyflie_link.parameters import FirmwareParameters
from crazyflie_link.subsystem import Subsystem, find_memory, write_memory
from crazyflie_link.transmission import Request

STATIONS = 16  #: Largest number of base stations of the firmware.

_TYPE = "lighthouse.systemType"
_STORE = bytes([Localization.LH_PERSIST_DATA])

_READ_LIMIT = 10.0  #: Time limit of reading all base stations of one kind of memory, s.
_ANGLE_LIMIT = 5.0  #: Time in which the vehicle must have measured angles often enough, s.
_FEWEST_ANGLES = 10  #: Least number of sets of angles from a visible base station.

_FLASH_LIMIT = 3.0  #: Time limit of storing (s): the vehicle may reorganise its flash memory.


class Lighthouse(Subsystem):
    """The base stations that the vehicle stores, and those that it sees."""

    def read(self) -> tuple[dict[int, LighthouseBsGeometry], dict[int, LighthouseBsCalibration]]:
        """Return the valid geometries and calibrations in the vehicle, by number; blocks."""
        link = self._current_link()
        find_memory(link, MemoryElement.TYPE_LH, "base stations")
        helper = LighthouseMemHelper(link.cflib)
        found = []
        for what, read in (
            ("geometries", helper.read_all_geos),
            ("calibrations", helper.read_all_calibs),
        ):
            pages = _wait(read, _READ_LIMIT)
            if pages is None:
                raise NoReplyError(
                    f"the {what} of base stations were not read in {_READ_LIMIT:g} s"
                )
            found.append({number: page for number, page in pages.items() if page.valid})
        return found[0], found[1]

    def angles(self) -> dict[int, LighthouseBsVectors]:
        """Return the mean angles of all base stations that are seen, by number; blocks for 1 s.

        They are compensated by the calibration. Empty if no base station is seen.
        """
        reader: LighthouseSweepAngleAverageReader

        def start(on_result: Callable[[Any], None]) -> None:
            nonlocal reader
            reader = LighthouseSweepAngleAverageReader(self._current_link().cflib, on_result)
            reader.start_angle_collection()

        measured = _wait(start, _ANGLE_LIMIT)
        if measured is None:
            reader.stop_angle_collection()
        return {
            number: vectors
            for number, (count, vectors) in sorted((measured or {}).items())
            if count >= _FEWEST_ANGLES
        }

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
            # cflib raises bare exceptions, and any error of an invalid file.
            reason = " ".join(str(error).split())
            raise ValueRangeError(
                f"lighthouse file {path}: {reason}; expected a lighthouse_system_configuration, as "
                "cfclient and cflib write it"
            ) from None
        if not geometries:
            raise ValueRangeError(
                f"lighthouse file {path}: the geometry of no base station; expected at least one"
            )
        if unknown:
            raise ValueRangeError(
                f"lighthouse file {path}: base station {unknown[0]!r}; expected 0 to {STATIONS - 1}"
            )
        if parameters.values().get(_TYPE) != system_type:
            # cflib's reader forgets all stations.
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


def _wait(start, limit):
    # Returns the result of a call of cflib that reports it later; None after the limit (s).
    results: queue.SimpleQueue[Any] = queue.SimpleQueue()
    start(results.put)
    try:
        return results.get(timeout=limit)
    except queue.Empty:
        return None
