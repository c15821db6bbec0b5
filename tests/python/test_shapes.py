"""Mass properties and outlines of shapes against closed forms."""

import math
import unittest

import numpy as np
from carom import SceneError, box, capsule, circle, hull, segment
from carom.plot import outline
from carom.shapes import from_json

ROUNDING = 1e-13  # a few dozen operations on numbers near 10


class Moments(unittest.TestCase):
    def check(self, shape, area, first, second):
        a, f, s = shape.moments()
        self.assertAlmostEqual(a, area, delta=ROUNDING * area)
        np.testing.assert_allclose(f, first, atol=ROUNDING * area)
        self.assertAlmostEqual(s, second, delta=ROUNDING * second)

    def test_disc_off_the_origin(self):
        area = math.pi * 4
        self.check(circle(2, center=(3, -1)), area, (3 * area, -area), area * (2 + 10))

    def test_box(self):
        self.check(box(2, 4), 8, (0, 0), 8 * (4 + 16) / 12)

    def test_triangle(self):
        # right triangle with legs a, b at the right angle: int x^2 = a^3 b/12
        self.check(hull([(0, 0), (3, 0), (0, 2)]), 3, (3, 2), (27 * 2 + 3 * 8) / 12)

    def test_capsule(self):
        a, r = 1.0, 0.5
        half = 4 * r / (3 * math.pi)  # centroid of a half disc
        disc, bar = math.pi * r * r, 4 * a * r
        second = (bar * (4 * a * a + 4 * r * r) / 12 + disc * (r * r / 2 - half**2)
                  + disc * (a + half) ** 2)
        self.check(capsule((-a, 0), (a, 0), r), disc + bar, (0, 0), second)

    def test_rounded_box_is_steiners_formula(self):
        # area = A + P r + pi r^2 for every convex shape
        self.check_area(box(2, 4, radius=0.3), 8 + 12 * 0.3 + math.pi * 0.09)
        self.check_area(hull([(0, 0), (3, 0), (0, 4)], 0.5), 6 + 12 * 0.5 + math.pi * 0.25)

    def check_area(self, shape, area):
        self.assertAlmostEqual(shape.moments()[0], area, delta=ROUNDING * area)

    def test_rounded_box_second_moment(self):
        # the box grown by r is a big box less four corners: square less quarter disc, each
        w, h, r = 2.0, 4.0, 0.3
        x, y = w / 2 + r, h / 2 + r
        big = 4 * x * y * (x * x + y * y) / 3
        quarter, c = math.pi * r * r / 4, 4 * r / (3 * math.pi)
        px, py = w / 2, h / 2  # the corner of the sharp box
        square = r * r * ((px + r / 2) ** 2 + (py + r / 2) ** 2) + r**4 / 6
        sector = quarter * (px * px + py * py + 2 * c * (px + py)) + math.pi * r**4 / 8
        self.assertAlmostEqual(box(w, h, r).moments()[2], big - 4 * (square - sector),
                               delta=ROUNDING * big)

    def test_segment_has_no_area(self):
        self.assertEqual(segment((-1, 0), (1, 0)).moments()[0], 0)


class Files(unittest.TestCase):
    def test_round_trip(self):
        shapes = [circle(2), circle(1, (0.5, 0)), box(1, 2), hull([(0, 0), (1, 0), (0, 1)], 0.1),
                  capsule((0, 0), (1, 0), 0.2), segment((0, 0), (1, 1))]
        for shape in shapes:
            self.assertEqual(from_json("s", shape.to_json()), shape)

    def test_faults_name_their_place(self):
        for data, text in [({"type": "cube"}, "s.type: must be one of circle"),
                           ({"type": "circle"}, "s.radius: must be given"),
                           ({"type": "circle", "radius": 1, "size": 2}, "s.size: unknown key"),
                           ({"type": "hull", "vertices": [[0]]}, "s: ")]:
            with self.assertRaisesRegex(SceneError, text):
                from_json("s", data)


class Outlines(unittest.TestCase):
    def test_area_of_the_outline(self):
        # inscribed polygon of n pieces a turn: the arcs lose (2 pi/n)^2/6 of their area
        for shape in (circle(2), box(2, 4, radius=0.5), capsule((-1, 0), (1, 0), 0.5), box(1, 1)):
            p = outline(shape, (0.7, 3, -2), arc=400)
            x, y = p[:, 0] - 3, p[:, 1] + 2
            area = np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2
            self.assertAlmostEqual(area, shape.moments()[0], delta=5e-5 * area)


if __name__ == "__main__":
    unittest.main()
