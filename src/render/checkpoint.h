#pragma once
// Checkpoints: files with the state of a rendering. The rendering can go on from one with the same bits, and the passes of
// several can be added, see Merging.

#include <memory>
#include <string>
#include <utility>

#include "render/checkpoint_header.h"
#include "render/render_report.h"
#include "render/renderer.h"
#include "system/section_file.h"

namespace etendue {

/// Where a scene comes from, as far as its Scene does not say.
struct SceneSource {
    uint64_t fingerprint = 0;  ///< See scene_fingerprint().
    bool lenient = false, watertight = false;
};

Conditions conditions_of(const Renderer& renderer, const Scene& scene, const SceneSource& source,
                         const RenderSettings& settings);
/// Whether the image of a checkpoint is that of this scene, whatever else its conditions are.
bool is_of(const CheckpointHeader& header, const Scene& scene, const SceneSource& source);

/// A checkpoint that is written, but not yet under its name, which commit() gives it when it is durable: that takes about as
/// long again, and another thread can do it. Throws std::runtime_error if it cannot be written; then one that was there
/// before is still there.
std::unique_ptr<SectionWriter> written_checkpoint(const std::string& file, const Renderer& renderer,
                                                  const Scene& scene, const Conditions& conditions,
                                                  const RenderSettings& settings,
                                                  const PassLog& log);

/// The sums of a rendering in the same format, for Merging. Nothing goes on from them.
std::string partial_result(const Renderer& renderer, const Scene& scene,
                           const Conditions& conditions, const RenderSettings& settings,
                           const PassLog& log);

/// Sums over the passes of one or more renderings.
struct RenderTotals {
    std::unique_ptr<Film> film;
    std::unique_ptr<TechniqueImages> techniques;  ///< nullptr if there are none.
    RenderStats stats;
    double seconds = 0;
    PassLog log;
};

/// A checkpoint that is read. All errors are std::runtime_error and name the file, which is open only while it is read.
class CheckpointFile {
public:
    /// Reads the description of the rendering.
    explicit CheckpointFile(SectionReader reader)
        : reader_(std::move(reader)), header_(load_header(reader_)) {}
    explicit CheckpointFile(const std::string& file) : CheckpointFile(SectionReader(file)) {}

    const std::string& name() const { return reader_.name(); }
    const CheckpointHeader& header() const { return header_; }
    /// Whether a rendering can go on from it. Otherwise it has only sums.
    bool has_state() const { return reader_.has("learned"); }
    /// Why a rendering with these conditions cannot go on from it, in words; empty if it can.
    std::string obstacle(const Conditions& conditions) const;
    /// Verifies every byte of the file.
    void check() { reader_.check(); }

    /// Loads the state into a new renderer. Throws, with all differences, if its conditions are not those of the file.
    void resume(Renderer& renderer, const Conditions& conditions, PassLog& log);
    /// Reads the sums. Unlike resume(), this is safe for any bytes.
    RenderTotals totals(bool with_techniques = true);

    SectionReader& sections() { return reader_; }

private:
    SectionReader reader_;
    CheckpointHeader header_;
};

}  // namespace etendue
