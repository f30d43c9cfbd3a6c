"""Tables B.4, B.5 and B.6 of the document, from its "true" robot at full precision.

That robot is the published FR3 with another link 7 (errata). Misprints are listed where they are
tested; everything else must agree within the rounding of the printed digits.
"""

import numpy as np
import pytest

from runtime.library import Library
from symgen.chain import read_chain
from tests.regrouping_rules import regrouped_base
from tests.taylor import Array

PI_7 = [
    1.2542865724,
    5.6726134989e-3,
    1.0819716922e-2,
    -2.0273441638e-2,
    9.4286696773e-4,
    8.0771244614e-4,
    3.3885162663e-4,
    -9.7599036040e-5,
    1.8297790402e-4,
    3.4976400656e-4,
]

TABLE_B4 = """
2.9275  2.9355  2.2449  2.6156  2.3271  1.8170  1.2543
0.0000  0.0093  0.0914 -0.1201 -0.0037  0.1085  0.0057
-0.0531 -0.2182 -0.0108 0.1649  0.0681 -0.0746  0.0108
-0.1130 0.0259 -0.0650 -0.0223 -0.2264 -0.0185 -0.0203
0.0293  0.0584  0.0260  0.0451  0.0756  0.0087  0.0009
0.0268  0.0254  0.0253  0.0346  0.0699  0.0207  0.0008
0.0073  0.0780  0.0228  0.0572  0.0184  0.0256  0.0003
0.0000  0.0009  0.0029  0.0208 -0.0056  0.0107 -0.0001
-0.0001 0.0040 -0.0002  0.0091 -0.0039  0.0025  0.0002
-0.0040 -0.0023 -0.0024 0.0004  0.0173 -0.0021  0.0004
"""

# (row of π, link): printed after rounding to 5 and then to 4 decimals → right after one rounding.
DOUBLE_ROUNDED = {
    ("ZZ", 2): (0.0780, 0.0779),
    ("XY", 3): (0.0029, 0.0028),
    ("XY", 6): (0.0107, 0.0106),
    ("YZ", 7): (0.0004, 0.0003),
}

TABLE_B5 = """
1.0741  1.0769  0.8087  0.9615  0.8446  0.5972  0.2266
0.0000  0.0032  0.0407 -0.0459 -0.0016  0.0597  0.0045
-0.0181 -0.0743 -0.0048 0.0630  0.0293 -0.0410  0.0086
-0.0386 0.0088 -0.0290 -0.0085 -0.0973 -0.0102 -0.0162
-0.0778 -2.0174 0.0255  0.7494 -0.3782  1.1721 -0.8127
-1.5610 -2.1220 -1.1784 0.8385 -1.3277 -0.1688 -0.9066
0.1123  0.0762  0.7770  2.2615 -0.7734 -0.5045 -1.6587
0.1424  0.1994  0.1195  0.1906  0.2119  0.1259  0.0223
0.0605  0.1523  0.1116  0.1227  0.1142  0.0408  0.0071
0.0495  0.0379  0.0686  0.0307  0.0047  0.0165  0.0071
"""

TABLE_B6 = """
0.0327  0.0093 -3.3950  0.0009  1.1412  0.0009  0.0040 -0.0023  0.7525  0.0115  0.0175
0.1487  0.0010 -0.0002 -0.0024 -0.5655  2.0115  0.6658  0.7860  0.1731  0.0091  0.0004
-0.0037 0.0866  0.0362  0.0489 -0.0056 -0.0039  0.0173  0.2189 -0.0543 -0.0210  0.0361
0.0089  0.0025 -0.0021  0.0057  0.0108  0.0001  0.0003 -0.0001  0.0002  0.0004
"""

# b_4 is printed as a copy of b_6; b_5 = 1.141147 and b_43 = YZ of link 7 were rounded twice.
MISPRINTED_B6 = {4: (0.0009, 1.0962), 5: (1.1412, 1.1411), 43: (0.0004, 0.0003)}

HALF_DIGIT = 0.5e-4 * (1 + 1e-9)
"""Half of the last printed decimal."""


def numbers(table: str) -> Array:
    return np.array([[float(word) for word in line.split()] for line in table.strip().splitlines()])


@pytest.fixture(scope="module")
def true_pi(fr3: Library) -> Array:
    """π of the document's robot, link by link."""
    pi = fr3.pi0.copy()
    pi[-10:] = PI_7
    return pi


def test_table_b4(true_pi: Array) -> None:
    """Oracle: all 70 standard parameters, four of them misprinted by double rounding."""
    names = ("m", "mX", "mY", "mZ", "XX", "YY", "ZZ", "XY", "XZ", "YZ")
    printed = numbers(TABLE_B4)
    for (name, link), (wrong, right) in DOUBLE_ROUNDED.items():
        assert printed[names.index(name), link - 1] == wrong
        assert abs(wrong - true_pi.reshape(7, 10)[link - 1, names.index(name)]) > HALF_DIGIT
        printed[names.index(name), link - 1] = right
    np.testing.assert_allclose(true_pi.reshape(7, 10).T, printed, rtol=0, atol=HALF_DIGIT)


def test_table_b5(fr3: Library, true_pi: Array) -> None:
    """Oracle: all 70 λ within half a digit, signs of the principal axes included."""
    lam = fr3.lam_from_pi(true_pi).reshape(7, 10).T
    np.testing.assert_allclose(lam, numbers(TABLE_B5), rtol=0, atol=HALF_DIGIT)


def printed_beta() -> Array:
    """Table B.6 with its misprints put right."""
    beta = np.array([float(word) for word in TABLE_B6.split()])
    for k, (wrong, right) in MISPRINTED_B6.items():
        assert beta[k - 1] == wrong
        beta[k - 1] = right
    return beta


def test_table_b6_by_regrouping(fr3: Library, true_pi: Array) -> None:
    """Oracle: 43 base parameters by the recursion of Gautier and Khalil."""
    _, matrix = regrouped_base(read_chain(fr3.urdf()))
    np.testing.assert_allclose(matrix @ true_pi, printed_beta(), rtol=0, atol=HALF_DIGIT)


def test_table_b6_by_the_sampled_regressor(fr3: Library, true_pi: Array) -> None:
    """Oracle: the same 43 values from the numeric base that the library ships."""
    np.testing.assert_allclose(fr3.base_matrix @ true_pi, printed_beta(), rtol=0, atol=HALF_DIGIT)
