"""A palletizer whose parallel linkages are joints that follow others, and a wheel geared to an arm."""

_MASS = '<inertial pos=".1 .02 .05" mass="{}" fullinertia="{} .002 .001 -.001"/>'


def _body(name: str, place: str, mass: float, inertia: str, joint: str, inner: str = "") -> str:
    return f"""<body name="{name}" pos="{place}">{_MASS.format(mass, inertia)}
      {joint}<geom name="{name}" type="sphere" size=".04" pos=".1 0 0"/>{inner}</body>"""


def _hinge(name: str, axis: str, reach: str, friction: str, more: str = "") -> str:
    return f'<joint name="{name}" axis="{axis}" range="{reach}" {friction} {more}/>'


_TOOL = _body(
    "tool",
    ".1 0 -.05",
    3,
    ".06 .05 .05",
    _hinge("roll", "0 0 -1", "-3 3", 'damping=".6" frictionloss="1.2"', 'actuatorfrcrange="-40 40"'),
)
_HAND = _body(
    "hand",
    ".6 0 0",
    2,
    ".03 .04 .03",
    _hinge("level", "0 1 0", "-1 .4", 'damping=".3" frictionloss=".4" armature=".01"'),
    _TOOL,
)
_UPPER = _body(
    "upper",
    ".1 0 .05",
    6,
    ".09 .3 .3",
    _hinge("reach", "0 1 0", "-.5 .9", 'damping="5" frictionloss="7"', 'actuatorfrcrange="-300 300"'),
    _HAND,
)
_PLATE = _body(
    "plate",
    "0 0 .6",
    2,
    ".03 .04 .03",
    _hinge("upright", "0 1 0", "-1 1", 'damping=".5" frictionloss=".6" stiffness="20" springref=".1"'),
    _UPPER,
)
_LOWER = _body(
    "lower",
    ".1 0 .2",
    8,
    ".6 .5 .2",
    _hinge(
        "lift",
        "0 1 0",
        "-.6 .9",
        'damping="9" frictionloss="12" armature=".2" stiffness="30" springref="-.2"',
        'actuatorfrcrange="-600 600"',
    ),
    _PLATE,
)
_COLUMN = _body(
    "column",
    "0 0 .3",
    20,
    ".5 .5 .4",
    _hinge("turn", "0 0 1", "-2.5 2.5", 'damping="8" frictionloss="10"', 'actuatorfrcrange="-400 400"'),
    _LOWER,
)
# The plate stays upright behind a bent lever, the hand level behind the plate's.
PALLETIZER = f"""
<mujoco model="palletizer"><compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="2 2 2.5 2 1.5 4"/>
    <numeric name="acceleration_limit" data="8 8 8 8 8 16"/>
  </custom>
  <worldbody>{_COLUMN}</worldbody>
  <contact><pair geom1="tool" geom2="lower"/></contact>
  <equality>
    <joint joint1="upright" joint2="lift" polycoef=".05 -1.1 0 0 0"/>
    <joint joint1="level" joint2="reach" polycoef="0 -1 0 0 0"/>
  </equality>
</mujoco>
"""

_ARM = """
<mujoco model="arm"><compiler angle="radian"/><worldbody>
  <body name="upper" pos="0 0 .5"><inertial pos=".15 0 .02" mass="4" fullinertia="{} .002 .001 -.001"/>
    <joint name="shoulder" axis="0 1 0" range="-2 2" armature=".1" damping="3" frictionloss="2"
           actuatorfrcrange="-80 80"/>
    <body name="lower" pos=".3 0 0"><inertial pos=".1 .01 0" mass="2" diaginertia=".004 .012 .014"/>
      <joint name="elbow" axis="0 1 0" range="-2 2" armature=".05" damping="1" frictionloss="1"
             actuatorfrcrange="-30 30"/></body>
  </body>{}</worldbody>{}</mujoco>
"""
# kg·m² of the wheel about its axle, and how much faster it turns than the shoulder.
WHEEL, RATIO = 0.01, -3.0
_WHEEL = f"""<body><inertial pos="0 0 0" mass="1" diaginertia="{WHEEL} {WHEEL} {WHEEL}"/>
    <joint name="wheel" axis="0 1 0"/></body>"""
_GEARS = f'<equality><joint joint1="wheel" joint2="shoulder" polycoef=".4 {RATIO} 0 0 0"/></equality>'
GEARED = _ARM.format(".02 .06 .07", _WHEEL, _GEARS)
# The shoulder turns about a fixed axis alone: its link may as well have that inertia all around.
WITH_ITS_INERTIA = _ARM.format(" ".join(str(each + RATIO**2 * WHEEL) for each in (0.02, 0.06, 0.07)), "", "")
