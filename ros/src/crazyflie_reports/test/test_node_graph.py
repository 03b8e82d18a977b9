"""The drawing of a node graph."""

from crazyflie_reports.node_graph import dot, main


def test_draws_topics_that_connect_nodes_and_no_others():
    published = [("/state", ["/estimator"]), ("/lonely", ["/estimator"]), ("/rosout", ["/x"])]
    subscribed = [("/state", ["/controller"]), ("/unheard", ["/controller"]), ("/rosout", ["/y"])]
    graph = dot(published, subscribed)
    assert '"/estimator" -> "topic /state";' in graph
    assert '"topic /state" -> "/controller";' in graph
    for absent in ("/lonely", "/unheard", "/rosout"):
        assert absent not in graph


def test_what_runs_is_not_drawn_where_nothing_runs(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    picture = tmp_path / "graph.svg"
    monkeypatch.setattr("sys.argv", ["graph", "--running", "--out", str(picture)])
    assert main() == 1
    assert "no ROS master at http://127.0.0.1:1" in capsys.readouterr().err
    assert not picture.exists()
