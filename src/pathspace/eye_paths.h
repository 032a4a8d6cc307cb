#pragma once
// The eye sub-paths of samples.

#include <span>

#include "pathspace/sample_context.h"

namespace etendue {

/// Traces the eye sub-path z[i] of each sample c[i]; at most kMostWalksInTurn of them, whose walks are made in turns. They
/// are the same as one by one.
void trace_eye_paths(const WalkContext& walk, std::span<const SampleContext> c,
                     std::span<SubPath> z);

}  // namespace etendue
