"""Compiled evaluation of forests."""

from greybed.core.jit import njit


@njit(cache=True, nogil=True, error_model="numpy")
def walk_trees(features, roots, feature, threshold, left, value, out):
    """Mean leaf values over all trees; children of a node stand side by side."""
    last = out.shape[1]
    for m in range(features.shape[0]):
        for k in range(last):
            out[m, k] = 0.0
        for root in roots:
            node = root
            while feature[node] >= 0:
                node = left[node] + (features[m, feature[node]] > threshold[node])
            for k in range(last):
                out[m, k] += value[node, k]
        for k in range(last):
            out[m, k] /= roots.size
