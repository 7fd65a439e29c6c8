"""Covariances of messages."""

from ros1_bridge.topics import message_covariance
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE, pose_matrix


def test_twist_matrix_has_the_variances_of_the_axes_that_are_measured():
    matrix = pose_matrix((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert [matrix[at] for at in (0, 1, 5, 7, 11, 35)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert [matrix[7 * i] for i in (2, 3, 4)] == [UNUSED_VARIANCE] * 3
    matrix = message_covariance.twist_matrix((1.0, 2.0, 3.0))
    assert [matrix[7 * i] for i in range(6)] == [1.0, 3.0, *[UNUSED_VARIANCE] * 3, 2.0]
