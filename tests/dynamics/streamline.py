"""Test oracle: the tank water as particles along the streamline, by Gauss quadrature.

Written apart from the package: it knows only the geometry and Newton's laws.
"""

from itertools import pairwise

import numpy as np

GRAVITY = 9.80665
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact to degree 7; the integrands reach 3


def particles(tank, h):
    """Positions, mass per particle, tangents and speed per dh/dt, each along axis -2.

    h has shape (n,); positions (n, 12, 3), masses (n, 12), lengths (n, 12), tangents (12, 3),
    speeds (12,).
    """
    x, half, bottom = tank.lx_m, tank.width_m / 2, tank.lz_m
    h = np.asarray(h, dtype=float)
    one = np.ones_like(h)
    corners = [  # port surface, port corner, starboard corner, starboard surface
        stack(x * one, -half * one, bottom - tank.height_m + h),
        stack(x * one, -half * one, bottom * one),
        stack(x * one, half * one, bottom * one),
        stack(x * one, half * one, bottom - tank.height_m - h),
    ]
    ends = pairwise(corners)
    areas = [tank.reservoir_area_m2, tank.duct_area_m2, tank.reservoir_area_m2]
    tangents = np.array([[0, 0, 1.0], [0, 1.0, 0], [0, 0, -1.0]])
    positions, masses, lengths = [], [], []
    for (start, stop), area, tangent in zip(ends, areas, tangents, strict=True):
        fraction = (NODES + 1) / 2
        positions.append(start[:, None, :] + fraction[:, None] * (stop - start)[:, None, :])
        weight = ((stop - start) @ tangent)[:, None] * WEIGHTS / 2
        lengths.append(weight)
        masses.append(tank.density_kg_m3 * area * weight)
    speeds = np.repeat(tank.reservoir_area_m2 / np.array(areas), len(NODES))
    return (
        np.concatenate(positions, axis=1),
        np.concatenate(masses, axis=1),
        np.concatenate(lengths, axis=1),
        np.repeat(tangents, len(NODES), axis=0),
        speeds,
    )


def stack(*columns):
    return np.stack(columns, axis=-1)


def rotation(roll, pitch, yaw):
    """Body to earth, from three plane rotations, shape (n, 3, 3)."""

    def plane(angle, i, j):
        matrix = np.zeros((*np.shape(angle), 3, 3))
        matrix[..., 0, 0] = matrix[..., 1, 1] = matrix[..., 2, 2] = 1.0
        matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
        matrix[..., i, j], matrix[..., j, i] = -np.sin(angle), np.sin(angle)
        return matrix

    return plane(yaw, 0, 1) @ plane(pitch, 2, 0) @ plane(roll, 1, 2)


def apply(matrix, vectors):
    """Rotate vectors (n, k, 3) or (n, 3)."""
    if vectors.ndim == matrix.ndim:
        return np.einsum("nij,nkj->nki", matrix, vectors)
    return np.einsum("nij,nj->ni", matrix, vectors)


class Motion:
    """n random smooth motions: polynomials in time for CG position, Euler angles and level."""

    def __init__(self, rng, n, level_limit):
        self.position = rng.uniform(-1, 1, (5, n, 3)) * np.array([0, 10, 2, 1, 0.5])[:, None, None]
        self.angles = rng.uniform(-1, 1, (5, n, 3)) * np.array([1.2, 1, 1, 0.5, 0.2])[:, None, None]
        self.level = rng.uniform(-1, 1, (5, n)) * np.array(
            [0.9 * level_limit, 2, 1, 0.5, 0.2]
        ).reshape(5, 1)

    def at(self, t, order=0):
        """Derivatives of the given order of (position, angles, level) at time t."""
        powers = np.array(
            [
                np.polynomial.polynomial.polyval(
                    t, np.polynomial.polynomial.polyder(np.eye(5)[k], order)
                )
                for k in range(5)
            ]
        )
        return tuple(np.tensordot(powers, c, 1) for c in (self.position, self.angles, self.level))

    def rates(self, t):
        """Body rates and their derivatives from the Euler angles' derivatives."""
        angles, dot, ddot = (self.at(t, order)[1] for order in (0, 1, 2))
        (phi, theta), (dphi, dtheta, dpsi) = angles[:, :2].T, dot.T
        ddphi, ddtheta, ddpsi = ddot.T
        s, c, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        rate = stack(dphi - st * dpsi, c * dtheta + s * ct * dpsi, -s * dtheta + c * ct * dpsi)
        rate_dot = stack(
            ddphi - st * ddpsi - ct * dtheta * dpsi,
            c * ddtheta
            + s * ct * ddpsi
            - s * dphi * dtheta
            + (c * ct * dphi - s * st * dtheta) * dpsi,
            -s * ddtheta
            + c * ct * ddpsi
            - c * dphi * dtheta
            - (s * ct * dphi + c * st * dtheta) * dpsi,
        )
        return rate, rate_dot

    def body_state(self, t):
        """Arguments of tank_wrench after the tank."""
        (_, angles, h), (vel, _, h_dot), (acc, _, h_ddot) = (self.at(t, k) for k in (0, 1, 2))
        to_body = np.swapaxes(rotation(*angles.T), 1, 2)
        rate, rate_dot = self.rates(t)
        velocity = apply(to_body, vel)
        acceleration = apply(to_body, acc) - np.cross(rate, velocity)
        return (
            h,
            h_dot,
            h_ddot,
            velocity,
            rate,
            acceleration,
            rate_dot,
            angles[:, 0],
            angles[:, 1],
        )

    def momentum(self, tank, t):
        """Earth-fixed momentum, and angular momentum about where the CG is at time zero."""
        (position, angles, h), (velocity, _, h_dot) = self.at(t, 0), self.at(t, 1)
        turn = rotation(*angles.T)
        rate, _ = self.rates(t)
        r, dm, _, tangents, speeds = particles(tank, h)
        flow = (h_dot[:, None] * speeds)[..., None] * tangents
        v = velocity[:, None, :] + apply(turn, np.cross(rate[:, None, :], r) + flow)
        arm = position[:, None, :] - self.at(0.0)[0][:, None, :] + apply(turn, r)
        return (np.einsum("nk,nki->ni", dm, v), np.einsum("nk,nki->ni", dm, np.cross(arm, v)))

    def paths(self, tank, t):
        """Earth-fixed positions at time t of the particles that are at the nodes at time zero."""
        h0 = self.at(0.0)[2]
        position, angles, h = self.at(t)
        r, _, _, tangents, speeds = particles(tank, h0)
        moved = r + ((h - h0)[:, None] * speeds)[..., None] * tangents
        return position[:, None, :] + apply(rotation(*angles.T), moved)
