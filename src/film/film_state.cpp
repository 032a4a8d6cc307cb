// Films in files, and sums of films.

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "film/film.h"
#include "film/parallel_chunks.h"
#include "system/section_file.h"

namespace etendue {
namespace {

/// Whether a film with this many passes has the luminance of a pass whose pair is still to come.
bool has_half_pair(uint64_t passes, bool has_groups) {
    return !has_groups && passes % 2 == 1;
}

}  // namespace

void Film::save(SectionWriter& to) const {
    to.begin("film");
    to.put(passes_);
    to.put(rejected_);
    to.put(uint8_t(is_merged_));
    to.put(moments_);
    to.put(pass_means_);
    to.put(pair_errors_);
    to.put(error2_of_pass_);
    to.put(group_passes_);
    for (const std::vector<float>& sums : group_sums_) to.put(sums);
    // A sum of films needs nothing for later passes.
    if (is_merged_) return;
    to.put(expected_.pixels_);
    to.put(uint8_t(!expected_.blocks_.empty()));
    if (has_half_pair(passes_, has_groups())) to.put(previous_);
}

void Film::load(SectionReader& from) {
    const uint64_t pixels = geometry_.pixel_count();
    from.open("film");
    from.get(passes_);
    from.get(rejected_);
    is_merged_ = from.get<uint8_t>() != 0;
    from.get(moments_, pixels, "pixels");
    from.get(pass_means_, passes_, "means of passes");
    std::vector<double> pairs;
    from.get(pairs);
    if (pairs.size() > passes_ / 2)
        from.fail(fmt::format("{} pairs of {} passes", pairs.size(), passes_));
    pair_errors_.clear(), later_pairs_ = {};
    for (const double error : pairs) {
        pair_errors_.push_back(error);
        count_last_pair();
    }
    from.get(error2_of_pass_);
    from.get(group_passes_);
    if (has_groups() && group_passes_.size() != group_sums_.size())
        from.fail(fmt::format("{} groups of passes, but expected {}", group_passes_.size(),
                              group_sums_.size()));
    uint64_t grouped = 0;
    for (const uint64_t passes : group_passes_) grouped += std::min(passes, passes_);
    if (!group_passes_.empty() && (group_passes_.size() % 2 != 0 || grouped != passes_))
        from.fail("the groups of passes do not make up the film");
    group_sums_.clear();
    for (size_t g = 0; g < group_passes_.size(); ++g)
        from.get(group_sums_.emplace_back(), pixels, "pixels of a group");
    if (has_groups()) previous_ = std::vector<float>();
    if (!is_merged_) {
        from.get(expected_.pixels_, pixels, "pixels");
        expected_.blocks_.clear();
        if (from.get<uint8_t>() != 0) expected_.average_blocks();
        if (has_half_pair(passes_, has_groups())) from.get(previous_, pixels, "pixels");
    }
    from.finish();
}

void Film::merge(const Film& other) {
    if (other.moments_.size() != moments_.size() || other.group_sums_.size() != group_sums_.size())
        throw std::runtime_error("films of other sizes or groups of passes cannot be added");
    for_film_chunks(moments_.size(), [&](uint64_t, uint64_t begin, uint64_t end) noexcept {
        for (uint64_t i = begin; i < end; ++i) {
            moments_[i].merge(other.moments_[i], double(passes_), double(other.passes_));
            for (size_t g = 0; g < group_sums_.size(); ++g)
                group_sums_[g][i] += other.group_sums_[g][i];
        }
    });
    for (size_t g = 0; g < group_passes_.size(); ++g) group_passes_[g] += other.group_passes_[g];
    pair_errors_.erase(pair_errors_.begin(), pair_errors_.begin() + long(noisy_pairs()));
    pair_errors_.insert(pair_errors_.end(), other.pair_errors_.begin() + long(other.noisy_pairs()),
                        other.pair_errors_.end());
    pass_means_.insert(pass_means_.end(), other.pass_means_.begin(), other.pass_means_.end());
    passes_ += other.passes_;
    rejected_ += other.rejected_;
    is_merged_ = true;
    if (!has_groups() && passes_ > 1) renew_error2_of_pass();
}

}  // namespace etendue
