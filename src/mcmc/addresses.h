#pragma once
// Vertices of Stream::Selection: the numbers by which states and proposals choose. Small steps of states keep them
// (NumberStep), so that numbers which only move a path belong to the streams of walks instead.

#include <cstdint>

namespace etendue::addresses {

/// Path length and technique of an independent state, or the kind of a mutation; the way to sample a remainder.
inline constexpr uint64_t kKind = 0;
/// Of mutations: which part is replaced, angles, distances. Of independent states near user paths: their length.
inline constexpr uint64_t kPart = 1;
/// Whether a light path follows a user path.
inline constexpr uint64_t kFollowsUserPath = 2;
/// The user path that is followed.
inline constexpr uint64_t kUserPath = 3;
/// From here on, at x_i: the angle by which a perturbation turns the direction there.
inline constexpr uint64_t kTurn = 16;

}  // namespace etendue::addresses
