"""The figures of a flight, on flights that are known in closed form."""

import csv
import math

import numpy as np
import pytest

from crazyflie_reports.flight_record import FlightRecord, FlightReport, Series

HOVER = (0.0, 0.0, 1.0)


def flight(hover_offset=0.0, sink=0.3, overshoot=0.0):
    """Return a record: 2 s of rise, 8 s of hover, then down at ``sink`` m/s."""
    record = FlightRecord()
    record.events = {"takeoff": 10.0, "flying": 14.0, "land": 20.0, "landed": 26.0}
    for time in np.arange(9.0, 26.0, 0.01):
        height, speed = 0.0, 0.0
        if 10.0 <= time < 12.0:
            height, speed = 0.5 * (time - 10.0), 0.5
        elif 12.0 <= time < 20.0:
            height = 1.0 + hover_offset + (overshoot if time < 12.5 else 0.0)
        elif time >= 20.0:
            height = max(0.0, 1.0 + hover_offset - sink * (time - 20.0))
            speed = -sink if height > 0.0 else 0.0
        record.state.append(time, [0.0, 0.0, height, 0.0, 0.0, speed, 0.0])
        record.final_control.append(time, [0.0, 0.0, 0.0, 9.81 if 10.0 < time < 25.0 else 0.0])
    return record


def test_time_to_hover():
    assert flight().time_to_hover(HOVER, 0.01) == pytest.approx(1.98, abs=0.02)
    assert flight(overshoot=0.1).time_to_hover(HOVER, 0.01) == pytest.approx(2.5, abs=0.02)
    assert math.isnan(flight(hover_offset=0.1).time_to_hover(HOVER, 0.01))


def test_references_of_a_climb_are_no_departure():
    record = flight()
    # The goal of the takeoff, the climb, and later a move.
    for time, height in ((10.0, 1.0), (10.1, 0.1), (11.0, 0.6), (12.0, 1.0), (17.0, 1.5)):
        record.reference.append(time, [0.0, 0.0, height, 0.0, 0.0, 0.0])
    assert record.hover_interval(HOVER) == (14.0, 17.0)
    assert record.time_to_hover(HOVER, 0.01) == pytest.approx(1.98, abs=0.02)


def test_what_was_not_reached_is_a_dash():
    record = flight(hover_offset=0.1, sink=0.01)
    table = FlightReport.of(record, HOVER).table()
    assert [line.split()[-1] for line in table.splitlines()][::4] == ["-", "-"]


def test_overshoot():
    assert flight(overshoot=0.1).overshoot(HOVER) == pytest.approx(0.1)
    assert flight(hover_offset=-0.2).overshoot(HOVER) == 0.0


def test_hover_error():
    assert flight(hover_offset=0.004).hover_error(HOVER, 5.0) == pytest.approx((0.004, 0.004))


def test_states_of_unknown_position_are_left_out():
    record, changed = flight(), flight()
    for time in (10.5, 13.0, 17.0, 19.99, 22.0, 27.0):
        changed.state.append(time, [0.0, 0.0, math.nan, 0.0, 0.0, math.nan, 0.0])
    rows = changed.state.rows
    changed.state = Series(changed.state.fields, rows[np.argsort(rows[:, 0], kind="stable")])
    assert FlightReport.of(changed, HOVER) == FlightReport.of(record, HOVER)
    assert FlightReport.of(changed, HOVER).complaints() == []
    assert changed.time_to_hover(HOVER, 0.01) == record.time_to_hover(HOVER, 0.01)


def test_no_figure_is_known_without_a_known_position():
    record = flight()
    rows = record.state.rows
    rows[:, 3] = math.nan
    record.state = Series(record.state.fields, rows)
    assert math.isnan(record.overshoot(HOVER))
    assert math.isnan(record.time_to_hover(HOVER, 0.01))
    assert math.isnan(record.touchdown_speed())
    with pytest.raises(ValueError, match="no state"):
        FlightReport.of(record, HOVER)


def test_what_is_recorded_meanwhile_is_left_out(tmp_path, monkeypatch):
    record, rows = flight(), Series.rows.fget
    record.reference.append(10.0, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    before = FlightReport.of(record, HOVER), len(record.tracking_errors()[0]), len(record.state)

    def growing(series):
        """Return the rows; another thread appends as soon as they are taken."""
        taken = rows(series)
        series.append(30.0, [0.0] * len(series.fields))
        return taken

    monkeypatch.setattr(Series, "rows", property(growing))
    report = FlightReport.of(record, HOVER)
    assert report.hover_error_max == before[0].hover_error_max
    assert report.touchdown_speed == before[0].touchdown_speed
    assert len(record.tracking_errors()[0]) >= before[1]
    record.save_csv(tmp_path / "flight.csv")
    assert len((tmp_path / "flight.csv").read_text().splitlines()) > before[2]


def test_touchdown_speed():
    assert flight(sink=0.3).touchdown_speed() == pytest.approx(0.3)
    assert math.isnan(flight(sink=0.01).touchdown_speed())


@pytest.mark.parametrize("overshoot", [0.0, 0.09])
def test_a_good_flight_has_no_complaints(overshoot):
    report = FlightReport.of(flight(overshoot=overshoot), HOVER)
    assert report.complaints() == []
    assert "touchdown speed" in report.table()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"hover_offset": 0.02}, "strayed 20.0 mm"),
        ({"overshoot": 0.12}, "rose 120 mm above the hover point"),
        ({"sink": 0.8}, "touched down at 0.80 m/s"),
        ({"sink": 0.01}, "above the ground"),
    ],
)
def test_a_bad_flight_is_called_so(change, complaint):
    complaints = FlightReport.of(flight(**change), HOVER).complaints()
    assert any(complaint in text for text in complaints)


def test_thrust_after_landing_is_bad():
    record = flight()
    record.final_control.append(26.0, [0.0, 0.0, 0.0, 5.0])
    assert "thrust is 5.00 m/s^2 after landing" in FlightReport.of(record, HOVER).complaints()


def test_csv_has_a_row_for_every_state(tmp_path):
    record = flight()
    path = tmp_path / "flight.csv"
    record.save_csv(path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(record.state)
    assert float(rows[-1]["z"]) == record.state.last[2]
    assert float(rows[300]["thrust"]) == 9.81
