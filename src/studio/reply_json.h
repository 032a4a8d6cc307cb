#pragma once
// The JSON of replies: runs, comparisons of runs, rays, and the paths of a pixel.

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "session/light_ray.h"
#include "session/opened_image.h"
#include "session/replay.h"
#include "session/session.h"

namespace etendue {

/// The text of a reply. NaN, which JSON does not have, becomes null; bytes that are not UTF-8, as files may contain, are
/// replaced.
std::string dump(const nlohmann::json& value);

nlohmann::json to_json(Vec3 v);
nlohmann::json to_json(Rgb c);
/// What changes from pass to pass.
nlohmann::json progress_of(const RunStatus& s);
nlohmann::json to_json(const RunStatus& s);
nlohmann::json to_json(const KeptRun& run);
nlohmann::json to_json(int id, const OpenedImage& image);
nlohmann::json to_json(const SeedComparison::Method& m, const SeedSeries& series);
/// The name of a technique in requests: connect-2-3.
std::string key_of(const Technique& q);
nlohmann::json to_json(const Technique& q);
nlohmann::json to_json(const std::vector<RayPoint>& points);
nlohmann::json to_json(const Replay& r);

}  // namespace etendue
