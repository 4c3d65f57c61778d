"""Compiled evaluation of forests."""

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def walk_trees(features, roots, feature, threshold, left, value, out):
    """Mean leaf values over all trees; children of a node stand side by side."""
    for m in range(features.shape[0]):
        first, second = 0.0, 0.0
        for root in roots:
            node = root
            while feature[node] >= 0:
                node = left[node] + (features[m, feature[node]] > threshold[node])
            first += value[node, 0]
            second += value[node, 1]
        out[m, 0] = first / roots.size
        out[m, 1] = second / roots.size
