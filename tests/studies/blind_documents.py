"""An answer of a blind case, and what a diagnosis says of it."""


def answer(kind="single", effect="stribeck_friction", joint="elbow", severity=0.6, **changes):
    acting = {"effect": effect, "joint": joint, "into": None, "severity": severity}
    acting |= {"law": None if kind == "unknown" else "exponential"}
    acting |= {"values": {"extra": 2.0}, "moved": 0.05}
    base = {
        "case": "case_0001",
        "kind": kind,
        "robot": "arm",
        "robot_error": 0.0,
        "joint_names": ["shoulder", "elbow"],
        "effects": [] if kind == "none" else [acting],
        "background": 0.0,
        "attempt": 0,
        "rejected": [],
        "settings": {"controller": "pd", "rate": 500.0, "motions": [1, 2], "channels": []},
        "floor": [1.0, 1.0],
    }
    return base | changes


def diagnosis(*named, verdict=None, where="elbow"):
    """named: effect, joint, probability, confusable_with, value of extra."""
    return {
        "format": "gap-diagnosis",
        "verdict": verdict or ("effect" if named else "none"),
        "effects": [
            {
                "effect": effect,
                "joint": joint,
                "probability": probability,
                "confusable_with": list(confusable),
                "parameters": {"extra": {"value": value, "std": 0.1, "unit": "N·m"}},
            }
            for effect, joint, probability, confusable, value in named
        ],
        "where": [{"joint": where}],
    }
