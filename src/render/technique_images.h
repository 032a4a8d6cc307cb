#pragma once
// One image per technique, weighted and unweighted: Veach's pyramid.

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "film/film.h"
#include "pathspace/technique.h"

namespace etendue {

class SectionReader;
class SectionWriter;

class TechniqueImages {
public:
    /// Images for paths of at most `max_edges` edges. See Film for `typical_radiance`.
    TechniqueImages(const FilmGeometry& geometry, const ReconstructionFilter& filter, int max_edges,
                    double typical_radiance = 1);
    ~TechniqueImages();

    void add(const FilmTarget& target, const Technique& technique, Rgb contribution,
             float mis_weight, float scale);
    void end_pass();
    /// Discards all contributions since the last end_pass().
    void drop_pass();

    /// Writes the sums as a section "techniques".
    void save(SectionWriter& to) const;
    /// Adds saved sums. Throws std::runtime_error if they are of an image of another size or of longer paths.
    void add_saved(SectionReader& from);

    struct Entry {
        Technique technique;
        std::vector<Rgb> weighted, unweighted;  ///< Means over the passes.
    };
    /// The images of techniques with contributions, in the order of length, then s.
    std::vector<Entry> images() const;
    /// At most, without pairs.
    static size_t memory_bytes(uint64_t pixels, int max_edges);

private:
    struct Layer;
    /// Creates the layer when it is first needed.
    Layer* layer(const Technique& technique);

    FilmGeometry geometry_;
    const ReconstructionFilter& filter_;
    int max_edges_;
    double typical_radiance_;
    uint64_t passes_ = 0;
    std::vector<std::atomic<Layer*>>
        layers_;  ///< In the order of number of vertices, then s, then pairs.
    std::vector<std::unique_ptr<Layer>> owned_;
    std::mutex creation_;
};

}  // namespace etendue
