"""Acclaim skeletons and motions that tests write."""

HEADER = """:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
"""
BONES = (  # name, parent, direction and length of a body in the units of an ASF
    ("lhipjoint", "root", "1 -1 0", 2), ("lfemur", "lhipjoint", "0 -1 0", 7), ("ltibia", "lfemur", "0 -1 0", 7),
    ("lfoot", "ltibia", "0 -1 1", 2), ("ltoes", "lfoot", "0 0 1", 1),
    ("rhipjoint", "root", "-1 -1 0", 2), ("rfemur", "rhipjoint", "0 -1 0", 7), ("rtibia", "rfemur", "0 -1 0", 7),
    ("rfoot", "rtibia", "0 -1 1", 2), ("rtoes", "rfoot", "0 0 1", 1),
    ("lowerback", "root", "0 1 0", 2), ("upperback", "lowerback", "0 1 0", 2), ("thorax", "upperback", "0 1 0", 2),
    ("lowerneck", "thorax", "0 1 0", 1), ("upperneck", "lowerneck", "0 1 0", 1), ("head", "upperneck", "0 1 0", 1),
    ("lclavicle", "thorax", "1 0.5 0", 3), ("lhumerus", "lclavicle", "1 0 0", 5), ("lradius", "lhumerus", "1 0 0", 3),
    ("lwrist", "lradius", "1 0 0", 1),
    ("rclavicle", "thorax", "-1 0.5 0", 3), ("rhumerus", "rclavicle", "-1 0 0", 5),
    ("rradius", "rhumerus", "-1 0 0", 3),
    ("rwrist", "rradius", "-1 0 0", 1),
)  # fmt: skip


def asf() -> str:
    """A skeleton with the names of CMU's."""
    bones = "".join(
        f"  begin\n     id {i}\n     name {name}\n     direction {way}\n     length {length}\n     axis 0 0 0  XYZ\n"
        f"     dof rx ry rz\n  end\n"
        for i, (name, _, way, length) in enumerate(BONES, 1)
    )
    parents = dict.fromkeys(parent for _, parent, _, _ in BONES)
    tree = "".join(f"    {p} {' '.join(n for n, q, _, _ in BONES if q == p)}\n" for p in parents)
    return f"{HEADER}:bonedata\n{bones}:hierarchy\n  begin\n{tree}  end\n"


def amc(frames: int) -> str:
    """A body that glides along z, 0.01 units a frame."""
    still = "".join(f"{name} 0 0 0\n" for name, *_ in BONES)
    moving = "".join(f"{k + 1}\nroot 0 17.8 {0.01 * k:.3f} 0 0 0\n{still}" for k in range(frames))
    return f"#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n{moving}"
