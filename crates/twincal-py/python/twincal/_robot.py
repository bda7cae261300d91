"""Robots: torque of a motion by the model alone, and the regressor of its inertial parameters."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from twincal import _twincal
from twincal._arrays import Floats, as_json, states


class Robot:
    """A robot model: a tree of joints, links and inertias. It never changes.

    Made by `Robot.from_urdf`, `Robot.from_mjcf` or `Robot.from_mjspec`; these take the keys of
    `[model]` of `twincal.toml` as keywords: `gravity`, `base`, `locked`, `use_urdf_friction`, `allow`.

    Attributes
    ----------
    name : str
        What the model calls the robot.
    joint_names : list of str
        The n moving joints, in the order of all arrays.
    torque_units : list of str
        "N·m" or, for a slider, "N"; one per joint.
    bodies : list of str
        The B moving bodies, in the order of the regressor.
    """

    def __init__(self, robot: _twincal.Robot, made_of: tuple[str, str | None, str]) -> None:
        if not isinstance(robot, _twincal.Robot):
            raise TypeError("a Robot is made by Robot.from_urdf, from_mjcf or from_mjspec")
        self._robot = robot
        self._made_of = made_of

    @classmethod
    def _make(cls, name: str, text: str | None, settings: str) -> Robot:
        """A robot of a file, or of the text of a model."""
        if text is None:
            robot = _twincal.Robot.read(name, settings)
        else:
            robot = _twincal.Robot.parse(name, text, settings)
        return cls(robot, (name, text, settings))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Robot._make, self._made_of)

    @classmethod
    def from_urdf(cls, path: str | os.PathLike[str], **settings: Any) -> Robot:
        """Reads a URDF file.

        Parameters
        ----------
        path : path
            The file; meshes are not opened.
        **settings
            Keys of `[model]`, such as `gravity=[0, 0, -9.81]` in m/s² or `locked={"finger": 0.0}`
            in rad or m.

        Returns
        -------
        Robot

        Raises
        ------
        twincal.errors.ContentError
            With file, line and column of what is wrong.
        twincal.errors.SettingError
            For an unknown or impossible setting.
        """
        return cls._make(os.fspath(path), None, as_json(settings))

    @classmethod
    def from_mjcf(cls, path: str | os.PathLike[str], **settings: Any) -> Robot:
        """Reads an MJCF file.

        Parameters
        ----------
        path : path
            The file; meshes are not opened.
        **settings
            As in `from_urdf`.

        Returns
        -------
        Robot

        Raises
        ------
        twincal.errors.ContentError, twincal.errors.SettingError
            As `from_urdf`.
        """
        return cls._make(os.fspath(path), None, as_json(settings))

    @classmethod
    def from_mjspec(cls, spec: Any, **settings: Any) -> Robot:
        """Takes a model that was put together in Python.

        Parameters
        ----------
        spec : mujoco.MjSpec
            Or anything whose `to_xml()` returns MJCF.
        **settings
            As in `from_urdf`.

        Returns
        -------
        Robot

        Raises
        ------
        TypeError
            For something without `to_xml`.
        twincal.errors.ContentError
            As `from_urdf`.
        """
        to_xml = getattr(spec, "to_xml", None)
        if not callable(to_xml):
            raise TypeError(f"{type(spec).__name__} has no to_xml(); give a mujoco.MjSpec")
        # A specification writes its XML only once it is compiled.
        compile_ = getattr(spec, "compile", None)
        if callable(compile_):
            compile_()
        return cls._make("model.xml", to_xml(), as_json(settings))

    @property
    def name(self) -> str:
        """What the model calls the robot; may be empty."""
        return self._robot.name

    @property
    def joint_names(self) -> list[str]:
        """Names of the n moving joints."""
        return self._robot.joint_names

    @property
    def torque_units(self) -> list[str]:
        """Unit of each joint's torque."""
        return self._robot.torque_units

    @property
    def bodies(self) -> list[str]:
        """Names of the B moving bodies."""
        return self._robot.bodies

    @property
    def parameter_names(self) -> list[str]:
        """Names of the ten inertial parameters of a body: m, mcx, …, Ixx, Ixy, Ixz, Iyy, Iyz, Izz."""
        return self._robot.parameter_names

    @property
    def findings(self) -> list[tuple[str, str]]:
        """Code and words of what had to be assumed of the model."""
        return self._robot.findings()

    @property
    def parameters(self) -> Floats:
        """Inertial parameters π of the model, shape (B, 10).

        Of each body in the frame of its link: mass in kg, first moments in kg·m, tensor about the
        origin of that frame in kg·m²; links that are fixed to it are part of it.
        """
        return self._robot.parameters().reshape(-1, 10)

    def inverse_dynamics(
        self, q: npt.ArrayLike, qd: npt.ArrayLike, qdd: npt.ArrayLike
    ) -> Floats:
        """Torque that a motion needs, by the model: τ = M(q) q̈ + bias(q, q̇).

        Motor inertia, damping and springs of the model are included.

        Parameters
        ----------
        q, qd, qdd : array_like, shape (..., n)
            Positions, velocities, accelerations: rad, rad/s, rad/s² (m for a slider). NaN gives NaN.

        Returns
        -------
        ndarray of float64, shape (..., n)
            N·m (N for a slider).

        Raises
        ------
        TypeError, ValueError
            For arrays of other types and shapes.
        """
        shape, arrays = states(len(self.joint_names), q, qd, qdd)
        tau = np.empty(arrays[0].shape)
        self._robot.inverse_dynamics(arrays, tau)
        return tau.reshape(shape)

    def regressor(self, q: npt.ArrayLike, qd: npt.ArrayLike, qdd: npt.ArrayLike) -> Floats:
        """Regressor Y of the inertial parameters: τ = Y(q, q̇, q̈) π.

        Motor inertia, damping and springs are not part of it.

        Parameters
        ----------
        q, qd, qdd : array_like, shape (..., n)
            As in `inverse_dynamics`.

        Returns
        -------
        ndarray of float64, shape (..., n, B, 10)
            N·m per unit of the parameter; parameters as in `parameters`.

        Raises
        ------
        TypeError, ValueError
            For arrays of other types and shapes.
        """
        shape, arrays = states(len(self.joint_names), q, qd, qdd)
        self._robot.require_regressor(arrays[0].size)
        values = np.empty(arrays[0].size * len(self.bodies) * 10)
        self._robot.regressor(arrays, values)
        return values.reshape(*shape, len(self.bodies), 10)

    def __repr__(self) -> str:
        return f"<twincal.Robot {self.name!r}: {', '.join(self.joint_names)}>"
