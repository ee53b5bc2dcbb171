//! `cf4` on tiles.

use super::{Tile, TileStep};
use crate::kernel::method::cf4;
use crate::kernel::method::slope::Turn;
use crate::math::lanes::{Each, GROUPS};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, outlined};
use crate::math::vector::Vector;
use crate::torque::tile::TileTime;

/// [`crate::kernel::method::cf4`].
pub(in crate::engine::cpu) struct Cf4;

impl TileStep for Cf4 {
    #[inline(always)]
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64) {
        tile.start(TileTime::Equal(index));
        let turn = Turn { omega: Vector::zero(), m: Vector::zero() };
        let (mut turns, mut second) = (Each([[turn; 4]; GROUPS]), Each([tile.state[0].orientation.value; GROUPS]));
        for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            if stage != 2 {
                tile.at(fraction);
            }
            outlined!(R, place_turned(tile, stage, &turns, &mut second));
            if tile.torques.has_expressions() {
                tile.form_expressions();
            }
            outlined!(R, form_turns(tile, stage, &mut turns));
        }
        for group in tile.active() {
            tile.state[group] = cf4::advanced(turns[group], tile.h[group], tile.state[group]);
        }
    }
}

/// Places the bodies of a tile at a stage of `cf4`; `second` is the attitude at the second stage.
#[inline(always)]
fn place_turned<R: Real>(
    tile: &mut Tile<'_, R>,
    stage: usize,
    turns: &Each<[Turn<R>; 4]>,
    second: &mut Each<Quaternion<R>>,
) {
    for group in tile.active() {
        let (q, m) = (tile.state[group].orientation.value, tile.state[group].angular_momentum_principal.value);
        let (dt, k) = (tile.h[group].value, &turns[group]);
        let half = dt * R::splat(0.5);
        let (q, m) = match stage {
            0 => (q, m),
            1 => (cf4::rotated(q, k[0].omega * half), k[0].m.axpy(half, m)),
            2 => (cf4::rotated(q, k[1].omega * half), k[1].m.axpy(half, m)),
            _ => (cf4::rotated(second[group], k[2].omega * dt - k[0].omega * half), k[2].m.axpy(dt, m)),
        };
        if stage == 1 {
            second[group] = q;
        }
        (tile.q[group], tile.m[group]) = (q, m);
    }
}

/// Forms the rates at the placed bodies.
#[inline(always)]
fn form_turns<R: Real>(tile: &mut Tile<'_, R>, stage: usize, turns: &mut Each<[Turn<R>; 4]>) {
    for group in tile.active() {
        let (omega, m) = tile.rates(group, tile.q[group], tile.m[group]);
        turns[group][stage % 4] = Turn { omega, m };
    }
}
