"""Tables B.4 to B.6: π of the document's robot, its λ and its base parameters."""

from runtime.experiments.study import Row, Study, StudyOutcome, View
from runtime.experiments.trials import document_robot
from runtime.library import Library
from runtime.library.parameters import LAM_NAMES, PI_NAMES, links

LINKS, BASE = 7, 43


def _run(lib: Library, numbers: range, threads: int) -> list[Row]:
    """Compute π and λ of every link, and β = K π."""
    pi = document_robot(lib)
    bodies, lam = links(pi), links(lib.lam_from_pi(pi))
    rows: list[Row] = []
    for link in range(LINKS):
        for method, names, values in (("pi", PI_NAMES, bodies), ("lam", LAM_NAMES, lam)):
            head = {"case": f"link {link + 1}", "method": method, "trial": 0}
            rows.append(head | dict(zip(names, values[link].tolist(), strict=True)))
    beta = (lib.base_matrix @ pi).tolist()
    head = {"case": "base", "method": "beta", "trial": 0}
    return [*rows, head | {f"b_{k}": value for k, value in enumerate(beta, start=1)}]


def _finish(lib: Library, rows: list[Row]) -> StudyOutcome:
    """Facts of the tables; there are no series."""
    return StudyOutcome(
        facts={
            "robot": "the URDF's inertials at full precision, link 7 with twice the mass and "
            "I_com = 2 I_com,URDF + 1e-4; Table B.4 is these, rounded twice",
            "lambda": "eigenvalues of I_com ascending, axes 1 and 2 signed by their largest "
            "entries, axis 3 = axis 1 x axis 2, quaternion logarithm",
            "base_columns": list(lib.manifest.base_columns),
        }
    )


STUDY = Study(
    name="appendix",
    title="Parameters of the FR3: π, λ and base",
    run=_run,
    finish=_finish,
    cases={**{f"link {k}": f"link {k}" for k in range(1, LINKS + 1)}, "base": "all links"},
    methods={
        "pi": "standard parameters, Table B.4: kg, kg·m, kg·m² about the link origin",
        "lam": "λ, Table B.5: ln kg, m, rad, kg^½·m",
        "beta": "base parameters, Table B.6",
    },
    trials=1,
    views=(
        View(
            "tables-B",
            "table",
            "Tables B.4 to B.6 from the generated manifest",
            cases=(*(f"link {k}" for k in range(1, LINKS + 1)), "base"),
            metrics=(*PI_NAMES, *LAM_NAMES, *(f"b_{k}" for k in range(1, BASE + 1))),
        ),
    ),
)
