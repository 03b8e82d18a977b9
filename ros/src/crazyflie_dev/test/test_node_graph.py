"""The drawing of a node graph."""

from crazyflie_dev.node_graph import dot


def test_draws_topics_that_connect_nodes_and_no_others():
    published = [("/state", ["/estimator"]), ("/lonely", ["/estimator"]), ("/rosout", ["/x"])]
    subscribed = [("/state", ["/controller"]), ("/unheard", ["/controller"]), ("/rosout", ["/y"])]
    graph = dot(published, subscribed)
    assert '"/estimator" -> "topic /state";' in graph
    assert '"topic /state" -> "/controller";' in graph
    for absent in ("/lonely", "/unheard", "/rosout"):
        assert absent not in graph
