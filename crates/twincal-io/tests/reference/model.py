"""Torque and limits of hand-written models by MuJoCo and Pinocchio, for crates/twincal-io/tests/model_features.rs.

    python crates/twincal-io/tests/reference/model.py

writes model.json beside this file: MJCF models of several files (mj_inverse without constraints), and robots that do not
stand upright, turned by a fixed joint (Pinocchio) or by a body (MuJoCo) instead of by turning gravity.
"""

import json
import pathlib
import tempfile

import mujoco
import numpy as np
import pinocchio as pin

HERE = pathlib.Path(__file__).parent
COMMAND = "python crates/twincal-io/tests/reference/model.py"
SAMPLES = 10
INERTIAL = '<inertial pos="0.02 -0.1 0.15" mass="1.7" diaginertia="0.03 0.02 0.015"/>'

MJCF = {
    "includes": {
        "main.xml": """
<mujoco>
  <include file="parts/settings.xml"/>
  <worldbody>
    <body name="column" pos="0 0 0.4"><joint name="turn"/><geom class="tube"/>
      <include file="parts/arm.xml"/>
    </body>
  </worldbody>
  <include file="parts/drives.xml"/>
</mujoco>""",
        "parts/settings.xml": """
<mujoco>
  <compiler angle="radian" eulerseq="XYZ"/>
  <default><joint armature="0.03" damping="0.2"/><default class="tube"><geom type="cylinder" size="0.04 0.2" density="2700"/></default></default>
</mujoco>""",
        # Paths of nested includes are those of the main file's folder.
        "parts/arm.xml": """
<mujocoinclude>
  <body name="arm" pos="0.1 0 0.2" euler="0.3 -0.2 0.5"><joint name="lift" axis="0 1 0"/><geom class="tube" euler="1.2 0.1 0"/>
    <include file="parts/hand.xml"/></body>
</mujocoinclude>""",
        "parts/hand.xml": f"""
<mujocoinclude><body pos="0 0 0.3"><joint name="slide" type="slide" axis="1 0 1" stiffness="30" springref="0.1"/>{INERTIAL}</body></mujocoinclude>""",
        "parts/drives.xml": """
<mujoco><actuator><motor name="m" joint="lift" gear="80 0 0 0 0 0" armature="2e-5"/></actuator></mujoco>""",
    },
    "limits": {
        "main.xml": f"""
<mujoco>
  <compiler autolimits="false"/>
  <default><default class="short"><joint range="-20 30"/></default></default>
  <worldbody>
    <body><joint name="stated" axis="0 1 0" range="-100 120" limited="true" actuatorfrcrange="-40 55" actuatorfrclimited="true"/>{INERTIAL}
      <body pos="0.1 0 0"><joint name="not_automatic" axis="1 0 0" limited="false" range="-1 1"/>{INERTIAL}
        <body pos="0 0.1 0"><joint name="by_class" class="short" limited="true"/>{INERTIAL}
          <body pos="0 0 0.1"><joint name="slider" type="slide" range="-0.3 0.4" limited="true"/>{INERTIAL}
            <body pos="0 0 0.1"><joint name="free_range" axis="0 1 0" limited="false" range="-10 10"/>{INERTIAL}</body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    },
    "automatic_limits": {
        "main.xml": f"""
<mujoco>
  <worldbody>
    <body><joint name="ranged" axis="0 1 0" range="-100 120"/>{INERTIAL}
      <body pos="0.1 0 0"><joint name="unlimited" axis="1 0 0" range="-10 10" limited="false"/>{INERTIAL}
        <body pos="0.1 0 0"><joint name="plain" actuatorfrcrange="-12 12"/>{INERTIAL}</body>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    },
    "orientations": {
        "main.xml": """
<mujoco>
  <compiler eulerseq="zxZ"/>
  <default><geom quat="0.7 0.1 -0.5 0.3"/></default>
  <worldbody>
    <body axisangle="1 2 -1 70" pos="0.1 0 0.5"><joint name="a" axis="0 1 0"/>
      <inertial pos="0.1 0 0" mass="1.1" diaginertia="0.02 0.03 0.04" euler="20 -40 60"/>
      <body xyaxes="0 1 0.2 -1 0 0.1" pos="0.3 0 0"><joint name="b" axis="1 0 0"/>
        <inertial pos="0 0.1 0" mass="0.9" diaginertia="0.02 0.01 0.015" axisangle="0 1 1 50"/>
        <body pos="0.2 0.1 0"><joint name="c" axis="0 1 1"/>
          <inertial pos="0 0.1 0.1" mass="0.7" diaginertia="0.02 0.01 0.015" xyaxes="1 0 1 0 1 0"/>
          <body euler="10 80 -30"><joint name="d" axis="0 1 0"/>
            <geom type="box" size="0.1 0.05 0.02" pos="0.1 0 0"/>
            <geom type="box" size="0.1 0.05 0.02" axisangle="1 0 1 35" mass="0.3"/>
            <geom type="capsule" size="0.03 0.1" xyaxes="1 1 0 -1 1 0" mass="0.2"/>
            <geom type="cylinder" size="0.03" fromto="0 0 0 0.1 0.2 0.3" density="1500"/>
            <geom type="ellipsoid" size="0.05 0.06 0.07" zaxis="0.3 -0.2 -0.9"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>""",
    },
    "balanced_full_inertia": {
        "main.xml": """
<mujoco>
  <compiler balanceinertia="true"/>
  <worldbody>
    <body><joint name="a" axis="0 1 0"/><inertial pos="0.1 0 0.2" mass="2" fullinertia="0.01 0.012 0.3 0.001 -0.002 0.003"/>
      <body pos="0 0 0.3"><joint name="b" axis="1 0 0"/><inertial pos="0.1 0 0" mass="1" fullinertia="0.02 0.03 0.025 0.001 -0.002 0.003"/></body>
    </body>
  </worldbody>
</mujoco>""",
    },
    "sections_in_pieces": {
        "main.xml": f"""
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -1"/>
  <default><joint damping="0.7"/></default>
  <worldbody>
    <body name="pedestal" pos="0 0 0.3" euler="0 0 0.4"><geom type="box" size="0.1 0.1 0.3"/>
      <body name="left" pos="0 0.2 0"><joint name="l1" axis="1 0 0"/>{INERTIAL}
        <body pos="0 0.2 0"><joint name="l2" axis="0 1 0"/>{INERTIAL}</body></body>
    </body>
  </worldbody>
  <default><joint armature="0.05"/><default class="stiff"><joint stiffness="4" springref="0.3"/></default></default>
  <worldbody>
    <frame childclass="stiff" pos="0 -0.2 0"><body name="right"><joint name="r1" axis="1 0 0"/>{INERTIAL}</body></frame>
  </worldbody>
  <compiler eulerseq="zyx"/>
  <option gravity="0.5 0 -9.7"/>
</mujoco>""",
    },
}


def inverse(model, rng):
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    samples = []
    for _ in range(SAMPLES):
        q, qd, qdd = (rng.normal(size=model.nv) * s for s in (1.2, 2.0, 5.0))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        samples.append({"q": q.tolist(), "qd": qd.tolist(), "qdd": qdd.tolist(), "tau": data.qfrc_inverse.tolist()})
    return samples


def limits(model):
    rows = []
    for i in range(model.njnt):
        ranged, forced = bool(model.jnt_limited[i]), bool(model.jnt_actfrclimited[i])
        rows.append(
            {
                "joint": model.joint(i).name,
                "range": model.jnt_range[i].tolist() if ranged else None,
                "effort": float(np.abs(model.jnt_actfrcrange[i]).max()) if forced else None,
            }
        )
    return rows


def mjcf_case(name, files, rng):
    with tempfile.TemporaryDirectory() as folder:
        for path, text in files.items():
            path = pathlib.Path(folder, path)
            path.parent.mkdir(exist_ok=True)
            path.write_text(text.strip())
        model = mujoco.MjModel.from_xml_path(str(pathlib.Path(folder, "main.xml")))
    stripped = {path: text.strip() for path, text in files.items()}
    return {"name": name, "files": stripped, "limits": limits(model), "samples": inverse(model, rng)}


URDF = """<robot name="arm">
{world}  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.02 -0.1 0.15" rpy="0.1 0.2 0.3"/><mass value="1.7"/>
    <inertia ixx="0.03" iyy="0.02" izz="0.015" ixy="0.001" ixz="-0.002" iyz="0.0005"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.05"/><mass value="0.8"/>
    <inertia ixx="0.01" iyy="0.012" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.3" rpy="0.2 0 0"/><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="50" velocity="3"/></joint>
  <joint name="slide" type="prismatic"><origin xyz="0.1 0.2 0" rpy="0 0.5 0.1"/><parent link="upper"/><child link="lower"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-1" upper="1" effort="50" velocity="3"/></joint>
</robot>
"""
WORLD = """  <link name="room"/>
  <joint name="mount" type="fixed"><origin rpy="{rpy}"/><parent link="room"/><child link="base"/></joint>
"""
TURNED = """<mujoco><compiler angle="radian" eulerseq="XYZ"/><worldbody>
  <body euler="{rpy}"><body pos="0 0 0.2" euler="0.1 0.2 0.3"><joint name="a" axis="0 1 0"/>{inertial}
    <body pos="0.3 0 0"><joint name="b" axis="1 0 0"/>{inertial}</body></body></body></worldbody></mujoco>
"""


def turned_cases(rng):
    cases = []
    for rpy in ([np.pi, 0, 0], [0, np.pi / 2, 0], [0.4, -1.1, 2.3]):
        words = " ".join(repr(float(angle)) for angle in rpy)
        model = pin.buildModelFromXML(URDF.format(world=WORLD.format(rpy=words)))
        data = model.createData()
        samples = []
        for _ in range(SAMPLES):
            q, qd, qdd = (rng.normal(size=model.nv) * s for s in (1.2, 2.0, 5.0))
            tau = pin.rnea(model, data, q, qd, qdd)
            samples.append({"q": q.tolist(), "qd": qd.tolist(), "qdd": qdd.tolist(), "tau": tau.tolist()})
        cases.append({"name": "arm.urdf", "model": URDF.format(world=""), "rpy": list(map(float, rpy)), "samples": samples})
        model = mujoco.MjModel.from_xml_string(TURNED.format(rpy=words, inertial=INERTIAL))
        upright = TURNED.format(rpy="0 0 0", inertial=INERTIAL)
        cases.append({"name": "arm.xml", "model": upright, "rpy": list(map(float, rpy)), "samples": inverse(model, rng)})
    return cases


def main():
    rng = np.random.default_rng(3)
    document = {
        "made_by": "crates/twincal-io/tests/reference/model.py",
        "version": f"MuJoCo {mujoco.__version__}, Pinocchio {pin.__version__}",
        "command": COMMAND,
        "mjcf": [mjcf_case(name, files, rng) for name, files in MJCF.items()],
        "turned": turned_cases(rng),
    }
    text = json.dumps(document, separators=(",", ":")).replace('{"name"', '\n{"name"') + "\n"
    (HERE / "model.json").write_text(text)
    print("model.json", len(text), "bytes")


if __name__ == "__main__":
    main()
