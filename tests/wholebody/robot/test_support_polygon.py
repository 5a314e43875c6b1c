import numpy as np

from wholebody.robot.support_polygon import convex_polygon


def test_the_margin_of_a_square_is_the_distance_to_its_nearest_edge():
    square = convex_polygon(np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.2, 0.3]]))
    assert len(square.offsets) == 4
    np.testing.assert_allclose(square.margin(np.array([0.5, 0.0])), 0.5)
    np.testing.assert_allclose(square.margin(np.array([1.5, 0.0])), -0.5)


def test_the_corners_go_counter_clockwise():
    polygon = convex_polygon(np.random.default_rng(0).normal(size=(30, 2)))
    x, y = polygon.vertices.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0
