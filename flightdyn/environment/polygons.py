"""Polygons on the ground: whether sides cross, and the convex parts of any."""

from collections.abc import Sequence

Point = tuple[float, float]


def crossing_sides(corners: Sequence[Point]) -> tuple[int, int] | None:
    """Return two sides of a polygon that have a point in common but for a shared corner.

    Side i goes from corner i to the next one.
    """
    n = len(corners)
    for i in range(n):
        for j in range(i + 1, n):
            a, b, c, d = (corners[k % n] for k in (i, i + 1, j, j + 1))
            if a == b or c == d:
                return i, j
            beside = j == i + 1 or (i == 0 and j == n - 1)
            if not beside and _meet(a, b, c, d):
                return i, j
    return None


def convex_parts(corners: Sequence[Point]) -> list[list[Point]]:
    """Return convex polygons, counterclockwise in (x, y), that make up a polygon.

    Parameters
    ----------
    corners : sequence of (x, y)
        In order, either way round; sides do not cross.

    Notes
    -----
    Ears are cut off until a triangle is left, then parts are joined where they stay convex: at
    most four times as many as there need be.

    References
    ----------
    .. [1] O'Rourke, *Computational Geometry in C*, 2nd edition, 1998, sections 1.6 (ears) and
       2.5 (convex partition by Hertel and Mehlhorn).
    """
    parts = [list(triangle) for triangle in _triangles(corners)]
    joined = True
    while joined:
        joined = False
        for i in range(len(parts)):
            for j in range(i + 1, len(parts)):
                both = _joined(parts[i], parts[j])
                if both is not None:
                    parts[i] = both
                    del parts[j]
                    joined = True
                    break
            if joined:
                break
    return parts


def _side(p: Point, q: Point, r: Point) -> float:
    """Return twice the area of a triangle, positive if it goes counterclockwise."""
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def _meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the lines from a to b and from c to d have a point in common."""
    across = _side(a, b, c) * _side(a, b, d), _side(c, d, a) * _side(c, d, b)
    if across == (0.0, 0.0):  # in one line
        return all(
            max(min(a[i], b[i]), min(c[i], d[i])) <= min(max(a[i], b[i]), max(c[i], d[i]))
            for i in range(2)
        )
    return across[0] <= 0 and across[1] <= 0


def _triangles(corners: Sequence[Point]) -> list[tuple[Point, Point, Point]]:
    left = list(corners)
    area = sum(_side((0.0, 0.0), left[i - 1], left[i]) for i in range(len(left)))
    if area < 0:
        left.reverse()
    found = []
    while len(left) > 3:
        n = len(left)
        ear = next(i for i in range(n) if _is_ear(left, i))
        found.append((left[ear - 1], left[ear], left[(ear + 1) % n]))
        del left[ear]
    found.append((left[0], left[1], left[2]))
    return [each for each in found if _side(*each) > 0]


def _is_ear(corners: Sequence[Point], i: int) -> bool:
    """Return whether a corner can be cut off: nothing of the polygon lies in its triangle."""
    n = len(corners)
    a, b, c = corners[i - 1], corners[i], corners[(i + 1) % n]
    if _side(a, b, c) < 0:
        return False
    if _side(a, b, c) == 0:  # no corner: nothing is cut off
        return True
    others = (p for p in corners if p not in (a, b, c))
    return not any(
        _side(a, b, p) >= 0 and _side(b, c, p) >= 0 and _side(c, a, p) >= 0 for p in others
    )


def _joined(first: list[Point], second: list[Point]) -> list[Point] | None:
    """Return two convex polygons with a common side as one, if that is convex."""
    for i in range(len(first)):
        a, b = first[i - 1], first[i]
        for j in range(len(second)):
            if (second[j - 1], second[j]) == (b, a):
                both = [*first[i:], *first[:i], *second[j + 1 :], *second[: j - 1]]
                if j == 0:
                    both = [*first[i:], *first[:i], *second[1:-1]]
                n = len(both)
                turns = [_side(both[k - 2], both[k - 1], both[k]) for k in range(n)]
                return both if min(turns) >= 0 else None
    return None
