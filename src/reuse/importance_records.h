#pragma once
// Importance records [Popov et al. 2015, §4.2, §6]: the contribution of each of V light vertices to some points of the
// scene, stored as cumulative mass functions. Eye vertices sample light vertices from a mixture of those of nearby
// records.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pathspace/vertex.h"

namespace etendue {

/// Replaces V masses by the V + 1 values, from 0 to 1, of their cumulative distribution; false where all are 0.
bool to_cdf(std::vector<float>& masses);

/// The mixture Σ_i w_i pmf_i over V light vertices, with one uniform component.
class VertexMixture {
public:
    static constexpr int kMostParts = 16;

    /// The uniform component has the weight 1 minus that of the parts.
    explicit VertexMixture(uint32_t vertices) : vertices_(vertices) {}
    /// Adds a part; `cdf` is the result of to_cdf() and must outlive the mixture.
    void add(const float* cdf, double weight) { parts_[size_t(count_++)] = {cdf, weight}; }

    struct Draw {
        uint32_t vertex;
        double pmf;
    };
    /// Chooses a component by its weight, then a vertex from it; `u` is in [0, 1).
    Draw sample(double u) const;
    /// Computed from differences of the values that sample() compares, so that rounding of the CDFs causes no bias.
    double pmf(uint32_t vertex) const;

private:
    struct Part {
        const float* cdf;
        double weight;
    };
    std::array<Part, kMostParts> parts_;
    int count_ = 0;
    uint32_t vertices_;
};

class ImportanceRecords {
public:
    /// Records of one chunk of eye paths; filled by one thread.
    class Chunk {
    public:
        void clear();
        /// Adds a record with the contributions of the light vertices to `z`, unless all of them are 0.
        void add(const Vertex& z, std::vector<float>& masses);

    private:
        friend class ImportanceRecords;
        struct Place {
            Vec3 p, ng, wo;
        };
        std::vector<Place> places_;
        std::vector<float> cdfs_;
    };

    ImportanceRecords();
    ~ImportanceRecords();

    /// Combines the chunks' records in order, independent of the threads that made them.
    void assemble(std::span<Chunk> chunks, uint32_t vertices);
    /// Mixture of the `neighbours` nearest records, weighted by similarity of normal and direction and by inverse
    /// distance, and of the uniform distribution with weight `uniform`, or 1 where no record has a positive weight.
    VertexMixture mixture(const Vertex& z, int neighbours, double uniform) const;

    size_t size() const { return places_.size(); }
    size_t memory_bytes() const;

private:
    struct Tree;

    std::vector<Chunk::Place> places_;
    std::vector<float> cdfs_;  ///< vertices_ + 1 of every record.
    uint32_t vertices_ = 0;
    std::unique_ptr<Tree> tree_;
};

}  // namespace etendue
