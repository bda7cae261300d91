"""Reference torques and energies for robot dynamics and model readers, from Pinocchio and MuJoCo.

    python crates/twincal/tests/reference/robot/make.py

writes pinocchio.json (random serial and tree robots as URDF and as the description the core reads) and mujoco.json
(hand-written MJCF models, one per group of features, mj_inverse without constraints) beside this file.
"""

import json
import pathlib

import mujoco
import numpy as np
import pinocchio as pin

HERE = pathlib.Path(__file__).parent
COMMAND = "python crates/twincal/tests/reference/robot/make.py"
SAMPLES = 10


def text(values):
    return " ".join(repr(float(v)) for v in values)


# ---------------------------------------------------------------- Pinocchio


def random_inertia(rng):
    """A body of random points: any tensor it gives is physical."""
    points = rng.normal(size=(6, 3)) * rng.uniform(0.05, 0.3)
    mass = float(rng.uniform(0.2, 5.0))
    com = rng.normal(size=3) * 0.2
    points -= points.mean(axis=0)
    tensor = sum(np.dot(p, p) * np.eye(3) - np.outer(p, p) for p in points) * mass / len(points)
    return mass, com, tensor


def random_robot(rng, name, kinds, parents, mimic=None):
    """kinds: r, c, p or f per joint; parents: index of the parent link (0 = base). Joint i carries link i + 1."""
    urdf = [f'<robot name="{name}">', '  <link name="link0"/>']
    links = [{"name": "link0", "inertia": None}]
    joints = []
    for i, (kind, parent) in enumerate(zip(kinds, parents)):
        mass, com, tensor = random_inertia(rng)
        rpy = rng.uniform(-3, 3, size=3)
        xyz, joint_rpy = rng.normal(size=3) * 0.3, rng.uniform(-3, 3, size=3)
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        inner = pin.rpy.rpyToMatrix(*rpy)
        turned = inner @ tensor @ inner.T
        word = {"r": "revolute", "c": "continuous", "p": "prismatic", "f": "fixed"}[kind]
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind in "rp" else ""
        follow = ""
        if mimic and i in mimic:
            leader, multiplier, offset = mimic[i]
            follow = f'<mimic joint="joint{leader}" multiplier="{multiplier}" offset="{offset}"/>'
        t = tensor.tolist()
        urdf.append(
            f'  <link name="link{i + 1}"><inertial><origin xyz="{text(com)}" rpy="{text(rpy)}"/><mass value="{mass!r}"/>'
            f'<inertia ixx="{t[0][0]!r}" ixy="{t[0][1]!r}" ixz="{t[0][2]!r}" iyy="{t[1][1]!r}" iyz="{t[1][2]!r}"'
            f' izz="{t[2][2]!r}"/></inertial></link>'
        )
        urdf.append(
            f'  <joint name="joint{i}" type="{word}"><origin xyz="{text(xyz)}" rpy="{text(joint_rpy)}"/>'
            f'<parent link="link{parent}"/><child link="link{i + 1}"/><axis xyz="{text(axis)}"/>{limit}{follow}</joint>'
        )
        links.append(
            {
                "name": f"link{i + 1}",
                "inertia": {"mass": mass, "com": com.tolist(), "tensor": ((turned + turned.T) / 2).tolist()},
            }
        )
        entry = mimic and mimic.get(i)
        joints.append(
            {
                "name": f"joint{i}",
                "kind": word,
                "parent": f"link{parent}",
                "child": f"link{i + 1}",
                "placement": {"rotation": pin.rpy.rpyToMatrix(*joint_rpy).tolist(), "translation": xyz.tolist()},
                "axis": axis.tolist(),
                "armature": 0.0,
                "damping": 0.0,
                "stiffness": 0.0,
                "spring_reference": 0.0,
                "mimic": entry and {"joint": f"joint{entry[0]}", "multiplier": entry[1], "offset": entry[2]},
                "limits": {"lower": None, "upper": None, "effort": None, "velocity": None},
            }
        )
    urdf.append("</robot>")
    gravity = (rng.normal(size=3) * 6).tolist()
    description = {"name": name, "gravity": gravity, "links": links, "joints": joints, "allow_unphysical": False}
    return "\n".join(urdf), description


def pinocchio_case(rng, name, kinds, parents, mimic=None):
    urdf, description = random_robot(rng, name, kinds, parents, mimic)
    # Without mimic in Pinocchio's model: the virtual work of a follower is added by hand below.
    plain = urdf
    if mimic:
        import re

        plain = re.sub(r"<mimic[^>]*/>", "", urdf)
    model = pin.buildModelFromXML(plain)
    model.gravity.linear = np.array(description["gravity"])
    data = model.createData()
    moving = [i for i, kind in enumerate(kinds) if kind != "f"]
    coordinates = [i for i in moving if not (mimic and i in mimic)]
    samples = []
    for _ in range(SAMPLES):
        q, qd, qdd = (rng.normal(size=len(coordinates)) * s for s in (1.5, 2.0, 5.0))
        row = {i: (q[k], qd[k], qdd[k]) for k, i in enumerate(coordinates)}
        for i, (leader, multiplier, offset) in (mimic or {}).items():
            a, b, c = row[leader]
            row[i] = (multiplier * a + offset, multiplier * b, multiplier * c)
        full_q = pin.neutral(model)
        full_v, full_a = np.zeros(model.nv), np.zeros(model.nv)
        for i in moving:
            joint = model.joints[model.getJointId(f"joint{i}")]
            position, velocity, acceleration = row[i]
            if joint.nq == 2:  # continuous: (cos, sin)
                full_q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
            else:
                full_q[joint.idx_q] = position
            full_v[joint.idx_v], full_a[joint.idx_v] = velocity, acceleration
        full_tau = pin.rnea(model, data, full_q, full_v, full_a)
        tau = np.zeros(len(coordinates))
        for i in moving:
            leader, multiplier = (mimic[i][0], mimic[i][1]) if mimic and i in mimic else (i, 1.0)
            tau[coordinates.index(leader)] += multiplier * full_tau[model.joints[model.getJointId(f"joint{i}")].idx_v]
        samples.append(
            {
                "q": q.tolist(),
                "qd": qd.tolist(),
                "qdd": qdd.tolist(),
                "tau": tau.tolist(),
                "kinetic": pin.computeKineticEnergy(model, data, full_q, full_v),
                "potential": pin.computePotentialEnergy(model, data, full_q),
            }
        )
    return {"name": name, "urdf": urdf, "description": description, "samples": samples}


def write_pinocchio():
    rng = np.random.default_rng(20261121)
    cases = [
        pinocchio_case(rng, "serial_6r", "rrrrrr", range(6)),
        pinocchio_case(rng, "sliders", "prpfrp", range(6)),
        pinocchio_case(rng, "tree", "rfrcprfrr", [0, 1, 2, 2, 4, 1, 6, 7, 0]),
        pinocchio_case(rng, "long", "rcrprfrcrprr", range(12)),
        pinocchio_case(rng, "gripper", "rrprrp", [0, 1, 2, 2, 4, 4], {3: (1, -0.5, 0.3), 5: (2, 2.0, -0.1)}),
    ]
    write("pinocchio.json", f"Pinocchio {pin.__version__}", cases)


# ---------------------------------------------------------------- MuJoCo

INERTIAL = '<inertial pos="0.02 -0.1 0.15" mass="1.7" diaginertia="0.03 0.02 0.015"/>'

MJCF = {
    "degrees_ref_spring": f"""
<mujoco model="degrees">
  <worldbody>
    <body name="upper" pos="0.1 0.2 0.3" euler="10 20 30">
      {INERTIAL}
      <joint name="shoulder" axis="1 2 3" pos="0.05 -0.02 0.1" range="-90 90" ref="25" springref="-12" stiffness="3.5"
             damping="0.4" armature="0.07"/>
      <body name="lower" pos="0 0.3 0" axisangle="0 1 1 40">
        <inertial pos="0 0.1 0" quat="0.9 0.1 -0.3 0.2" mass="0.8" diaginertia="0.01 0.012 0.004"/>
        <joint name="slide" type="slide" axis="0 0.6 0.8" ref="0.3" springref="0.1" stiffness="20" damping="2"
               armature="0.5"/>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    "radians_eulerseq_axes": f"""
<mujoco>
  <compiler angle="radian" eulerseq="zYx"/>
  <option gravity="1 -2 -9"/>
  <worldbody>
    <body euler="0.3 -0.4 1.2" pos="0 0 1">
      {INERTIAL}
      <joint name="a" axis="0 1 0"/>
      <body xyaxes="1 1 0 -0.5 1 0.3" pos="0.2 0 0.1">
        <inertial pos="0 0 0.1" mass="1" fullinertia="0.02 0.03 0.025 0.001 -0.002 0.003"/>
        <joint name="b" axis="1 0 0" ref="0.7"/>
        <body zaxis="0.2 -0.5 0.7" pos="0.2 0 0.1">
          <inertial pos="0.1 0 0" mass="0.6" diaginertia="0.002 0.002 0.001" zaxis="1 1 1"/>
          <joint name="c"/>
        </body>
      </body>
      <body zaxis="0 0 -1" pos="-0.2 0 0.1">
        <inertial pos="0.1 0 0" mass="0.6" diaginertia="0.002 0.002 0.001"/>
        <joint name="d" axis="1 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    "several_joints_per_body": f"""
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="carriage" pos="0.1 0 0.4" quat="0.8 0.2 -0.1 0.5">
      <joint name="x" type="slide" axis="1 0 0" ref="0.2"/>
      <joint name="tilt" axis="0 1 0" pos="0.1 0.2 0.3" ref="-0.4"/>
      <joint name="y" type="slide" axis="0 1 0.5"/>
      <joint name="pan" axis="0 0.2 1" pos="-0.1 0.05 0.2" ref="0.6"/>
      {INERTIAL}
      <body name="tool" pos="0.3 0.1 0" euler="0.1 0.2 0.3">
        <joint name="roll" axis="1 0 0" pos="0 0.1 0"/>
        <joint name="bend" axis="0 1 0" pos="0.1 0 0"/>
        {INERTIAL}
      </body>
      <body name="rigid" pos="0 0.1 0.2" euler="0.5 0 0">
        {INERTIAL}
        <body name="flap"><joint name="flap" pos="0 0 0.1" axis="1 1 1"/>{INERTIAL}</body>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    "default_classes": f"""
<mujoco>
  <default>
    <joint damping="0.5" axis="0 1 0"/>
    <geom density="700"/>
    <default class="arm">
      <joint armature="0.2"/>
      <geom type="capsule" size="0.03 0.1" euler="0 90 0"/>
      <default class="wrist">
        <joint damping="0.1" stiffness="1.5" springref="30"/>
        <geom size="0.02"/>
        <motor armature="0.001" gear="20"/>
      </default>
    </default>
    <default class="rail"><joint type="slide" axis="1 0 0" damping="4"/></default>
  </default>
  <worldbody>
    <body childclass="arm" pos="0 0 1">
      <joint name="base" class="rail"/>
      <geom/>
      <body pos="0.2 0 0">
        <joint name="elbow"/>
        <geom/>
        <body pos="0.2 0 0" childclass="wrist">
          <joint name="wrist"/>
          <geom/>
          <geom class="arm" pos="0 0 0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m1" joint="elbow"/>
    <motor name="m2" joint="wrist" class="wrist"/>
    <position name="m3" joint="base" kp="100" gear="3" armature="0.01" damping="0.02"/>
  </actuator>
</mujoco>""",
    "inertia_from_geoms": """
<mujoco>
  <compiler inertiagrouprange="0 2"/>
  <worldbody>
    <body pos="0 0 1">
      <joint name="a" axis="0 1 0"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.1 0 0" euler="10 20 30"/>
      <geom type="sphere" size="0.07" pos="0 0.2 0.1" mass="0.4"/>
      <geom type="cylinder" size="0.05 0.2" pos="0 0 0.1" quat="0.5 0.1 0.3 0.2" density="500" contype="0"/>
      <geom type="box" size="1 1 1" group="3"/>
      <geom type="box" size="1 1 1" mass="0"/>
      <body pos="0.3 0 0">
        <joint name="b" axis="1 0 0"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0.3 0.1 0.2"/>
        <geom type="ellipsoid" size="0.1 0.05 0.2" pos="0 0.1 0" zaxis="1 1 0"/>
        <geom type="box" size="0.03" fromto="0 0 0 0 0.4 0.1" density="2000"/>
        <frame pos="0.1 0 0" euler="0 45 0">
          <geom type="box" size="0.02 0.05 0.1" pos="0 0 0.2"/>
          <frame euler="30 0 0"><body pos="0 0 0.3">
            <joint name="c" axis="0 0 1" pos="0.05 0 0"/>
            <geom type="ellipsoid" size="0.04" fromto="0 0 0 0.2 0 0"/>
            <geom type="mesh" mesh="never_opened" mass="0"/>
          </body></frame>
        </frame>
      </body>
    </body>
    <geom type="plane" size="1 1 1"/>
  </worldbody>
</mujoco>""",
    "frames_hold_everything": """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <frame pos="0 0 1" euler="0.2 0.1 0.4">
      <body pos="0.1 0 0" euler="0 0 0.3">
        <frame pos="0.05 0.02 0.1" euler="0.4 0 0">
          <joint name="a" axis="0 1 0" pos="0 0 0.1" ref="0.1"/>
          <inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.03 0.04"/>
        </frame>
        <body name="inner">
          <joint name="b" axis="1 0 0"/>
          <inertial pos="0 0 0.1" mass="1" diaginertia="0.02 0.03 0.04"/>
        </body>
      </body>
    </frame>
  </worldbody>
</mujoco>""",
    "bounds_and_total_mass": """
<mujoco>
  <compiler boundmass="0.5" boundinertia="0.01" balanceinertia="true" settotalmass="7"/>
  <worldbody>
    <body>
      <joint name="a" axis="0 1 0"/>
      <inertial pos="0.1 0 0.2" mass="0.1" diaginertia="0.03 0.002 0.025" euler="10 20 30"/>
      <body pos="0 0 0.3">
        <joint name="b" axis="1 0 0"/>
        <inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.01 0.4" euler="10 20 30"/>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    "inertia_always_from_geoms": f"""
<mujoco>
  <compiler inertiafromgeom="true"/>
  <option gravity="0 0 -3"><flag gravity="enable"/></option>
  <worldbody>
    <body><joint name="a" axis="0 1 0"/>{INERTIAL}<geom size="0.1" pos="0.2 0 0"/>
      <body pos="0 0 0.3"><joint name="b" axis="1 0 0"/>{INERTIAL}</body>
    </body>
  </worldbody>
</mujoco>""",
    "no_gravity": f"""
<mujoco>
  <option><flag gravity="disable"/></option>
  <worldbody>
    <body><joint name="a" axis="0 1 0"/>{INERTIAL}
      <body pos="0 0 0.3"><joint name="b" axis="1 0 0"/>{INERTIAL}</body>
    </body>
  </worldbody>
</mujoco>""",
}


def mujoco_case(rng, name, xml):
    # The mesh that is never opened has no mass, so MuJoCo's answer does not need it either.
    model = mujoco.MjModel.from_xml_string(xml.replace('<geom type="mesh" mesh="never_opened" mass="0"/>', ""))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    samples = []
    for _ in range(SAMPLES):
        q, qd, qdd = (rng.normal(size=model.nv) * s for s in (1.2, 2.0, 5.0))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        samples.append({"q": q.tolist(), "qd": qd.tolist(), "qdd": qdd.tolist(), "tau": data.qfrc_inverse.tolist()})
    joints = [model.joint(i).name for i in range(model.njnt)]
    return {"name": name, "mjcf": xml.strip(), "joints": joints, "samples": samples}


def write_mujoco():
    rng = np.random.default_rng(4)
    write(
        "mujoco.json",
        f"MuJoCo {mujoco.__version__}",
        [mujoco_case(rng, name, xml) for name, xml in MJCF.items()],
    )


def write(file, version, cases):
    made_by = "crates/twincal/tests/reference/robot/make.py"
    document = {"made_by": made_by, "version": version, "command": COMMAND, "cases": cases}
    (HERE / file).write_text(json.dumps(document, indent=None, separators=(",", ":")).replace('{"name"', '\n{"name"') + "\n")
    print(file, (HERE / file).stat().st_size, "bytes")


if __name__ == "__main__":
    write_pinocchio()
    write_mujoco()
