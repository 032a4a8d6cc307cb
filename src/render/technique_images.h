#pragma once
// One image per technique, weighted and unweighted: Veach's pyramid.

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "film/film.h"
#include "pathspace/technique.h"

namespace etendue {

class TechniqueImages {
public:
    /// For paths of at most `max_edges` edges; `typical_radiance` as for the film.
    TechniqueImages(const FilmGeometry& geometry, const ReconstructionFilter& filter, int max_edges,
                    double typical_radiance = 1);
    ~TechniqueImages();

    void add_eye(uint64_t pixel, const Technique& technique, Rgb contribution, float mis_weight);
    void add_splat(Vec2 film, const Technique& technique, Rgb contribution, float mis_weight,
                   float scale);
    void end_pass();
    /// Forgets what was added since the last end_pass().
    void drop_pass();

    struct Entry {
        Technique technique;
        std::vector<Rgb> weighted, unweighted;  ///< Means over the passes.
    };
    /// Those that received anything, by length, then s.
    std::vector<Entry> images() const;
    /// At most, without pairs.
    static size_t memory_bytes(uint64_t pixels, int max_edges);

private:
    struct Layer;
    /// Made when it is first asked for.
    Layer* layer(const Technique& technique);

    FilmGeometry geometry_;
    const ReconstructionFilter& filter_;
    int max_edges_;
    double typical_radiance_;
    uint64_t passes_ = 0;
    std::vector<std::atomic<Layer*>> layers_;  ///< By number of vertices, then s, then pairs.
    std::vector<std::unique_ptr<Layer>> owned_;
    std::mutex creation_;
};

}  // namespace etendue
