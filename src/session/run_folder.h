#pragma once
// The folder in which the runs of a session are kept, as checkpoints.

#include <cstdint>
#include <string>
#include <vector>

#include "session/loaded_scene.h"

namespace etendue {

/// A file of the folder.
struct KeptRun {
    std::string file;  ///< Its name in the folder.
    std::string integrator;
    uint64_t seed = 0, passes = 0;
    int seeds = 1, finished_seeds = 0;  ///< With several, `passes` are those of all of them.
    std::string problem;  ///< Why it cannot be read; then nothing else of it is known.
};

class RunFolder {
public:
    static constexpr const char* kExtension = ".etd";

    explicit RunFolder(std::string folder) : folder_(std::move(folder)) {}

    const std::string& path() const { return folder_; }
    std::string path_of(const std::string& name) const { return folder_ + "/" + name; }
    /// The runs of a scene, and what cannot be read; the newest first.
    std::vector<KeptRun> list(const LoadedScene& scene) const;
    /// Takes a name that says scene, method and a number, by an empty file of this name, where there is no other. Throws
    /// std::runtime_error if this is impossible.
    std::string take_name(const std::string& scene_file, const std::string& method) const;
    /// Removes the file if it is still empty.
    void give_back(const std::string& name) const noexcept;

private:
    std::string folder_;
};

}  // namespace etendue
