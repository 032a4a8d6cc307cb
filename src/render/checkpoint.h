#pragma once
// Checkpoints: files with the state of a rendering. The rendering can go on from one with the same bits, and the passes of
// several can be added.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "render/render_report.h"
#include "render/renderer.h"
#include "system/section_file.h"

namespace etendue {

/// Where a scene comes from, as far as its Scene does not say.
struct SceneSource {
    uint64_t fingerprint = 0;  ///< See scene_fingerprint().
    bool lenient = false, watertight = false;
};

/// Everything that decides the bits of passes, as names and values for people. With equal conditions, equal passes have
/// equal bits.
using Conditions = std::vector<std::pair<std::string, std::string>>;
constexpr const char* kIntegratorCondition = "integrator";  ///< Name of that of the method.
Conditions conditions_of(const Renderer& renderer, const Scene& scene, const SceneSource& source,
                         const RenderSettings& settings);

/// Throws std::runtime_error if the file cannot be written; then one that was there before is still there.
void write_checkpoint(const std::string& file, const Renderer& renderer, const Scene& scene,
                      const Conditions& conditions, const RenderSettings& settings,
                      const PassLog& log);

/// The sums of a rendering in the same format, for Merging. Nothing goes on from them.
std::string partial_result(const Renderer& renderer, const Scene& scene,
                           const Conditions& conditions, const RenderSettings& settings,
                           const PassLog& log);

/// Passes first … first + passes - 1 of a seed.
struct PassRange {
    uint64_t seed = 0, first = 0, passes = 0;

    friend auto operator<=>(const PassRange&, const PassRange&) = default;
};
std::string to_string(const PassRange& range);

/// Sums over the passes of one or more renderings.
struct RenderTotals {
    std::unique_ptr<Film> film;
    std::unique_ptr<TechniqueImages> techniques;  ///< nullptr if there are none.
    RenderStats stats;
    double seconds = 0;
    PassLog log;
};

/// A checkpoint that is read. All errors are std::runtime_error and name the file.
class CheckpointFile {
public:
    /// Reads the description of the rendering.
    explicit CheckpointFile(SectionReader reader);
    explicit CheckpointFile(const std::string& file) : CheckpointFile(SectionReader(file)) {}

    const std::string& name() const { return reader_.name(); }
    const Conditions& conditions() const { return conditions_; }
    /// What the conditions say of `name`; empty if there is no such condition.
    std::string condition(const std::string& name) const;
    /// In order; more than one if it is a sum.
    const std::vector<PassRange>& ranges() const { return ranges_; }
    uint64_t passes() const;
    bool is_merged() const { return is_merged_; }
    const std::string& scene() const { return scene_; }
    const std::string& integrator() const { return integrator_; }
    const std::string& estimator() const { return estimator_; }  ///< As to_string() gives it.
    int width() const { return geometry_.crop_width; }
    int height() const { return geometry_.crop_height; }
    int technique_depth() const {
        return technique_depth_;
    }  ///< 0 if there are no technique images.
    /// Verifies every byte of the file.
    void check() { reader_.check(); }

    /// Loads the state into a new renderer. Throws, with all differences, if its conditions are not those of the file.
    void resume(Renderer& renderer, const Conditions& conditions, PassLog& log);
    /// Reads the sums. Unlike resume(), this is safe for any bytes.
    RenderTotals totals(bool with_techniques = true);

private:
    friend class Merging;
    void read_header();

    SectionReader reader_;
    Conditions conditions_;
    std::vector<PassRange> ranges_;
    FilmGeometry geometry_;
    std::string scene_, integrator_, estimator_;
    int technique_depth_ = 0;
    bool is_merged_ = false;
};

/// Renderings of one scene by one method, whose passes are all different.
class Merging {
public:
    /// Throws std::runtime_error if some of them do not belong together. Sorts them, so that nothing depends on their order.
    explicit Merging(std::vector<CheckpointFile> parts);

    /// Adds up the sums.
    RenderTotals totals();
    /// What more seeds cannot improve, in words.
    std::vector<std::string> warnings() const;
    /// Statistics by name, as to_json() of a rendering gives them.
    nlohmann::json report(const RenderTotals& totals) const;
    /// Writes the sums as a file that can be merged again.
    void write(const std::string& file, const RenderTotals& totals) const;
    /// The same as bytes.
    std::string bytes(const RenderTotals& totals) const;
    const CheckpointFile& first() const { return parts_.front(); }

private:
    void save(const RenderTotals& totals, SectionWriter& to) const;

    std::vector<CheckpointFile> parts_;
    std::vector<PassRange> ranges_;
};

}  // namespace etendue
