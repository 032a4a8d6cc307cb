#pragma once
// Importance records [Popov et al. 2015, §4.2, §6]: what each of V light vertices brings to some points of the scene, kept
// as cumulative mass functions. An eye vertex draws light vertices from a mixture of those near it.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pathspace/vertex.h"

namespace etendue {

/// Turns V masses into the V + 1 values, from 0 to 1, of their cumulative distribution; false where all are 0.
bool to_cdf(std::vector<float>& masses);

/// Σ_i w_i pmf_i over V light vertices, one summand being uniform.
class VertexMixture {
public:
    static constexpr int kMostParts = 16;

    /// Uniform with the weight that the parts leave of 1.
    explicit VertexMixture(uint32_t vertices) : vertices_(vertices) {}
    /// `cdf` as from to_cdf(); it must outlive the mixture.
    void add(const float* cdf, double weight) { parts_[size_t(count_++)] = {cdf, weight}; }

    struct Draw {
        uint32_t vertex;
        double pmf;
    };
    /// From `u` in [0, 1): chooses a summand by its weight, then a vertex by that summand alone.
    Draw sample(double u) const;
    /// From differences of the values that sample() compares, so that rounding of the CDFs does not bias.
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
    /// Records along one eye path; filled by one thread.
    class Chunk {
    public:
        void clear();
        /// What the light vertices bring to `z`; where all is 0 there is no record.
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

    /// Takes the chunks' records in order, whichever threads made them.
    void assemble(std::span<Chunk> chunks, uint32_t vertices);
    /// Of the `neighbours` nearest records, those weighted more whose normal and direction are alike and that are near,
    /// and of the uniform distribution with the share `uniform`: all of it where no record has a weight.
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
