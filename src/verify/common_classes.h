#pragma once
// Which classes of paths a method is compared on, and with which of the references.

#include <map>
#include <span>

#include "verify/run_series.h"

namespace etendue {

/// Contributions of both sides to one mean, and how many the method should have by what the references found.
struct SideTallies {
    Tally method, reference, implied;

    SideTallies& operator+=(const SideTallies& o) {
        method += o.method, reference += o.reference, implied += o.implied;
        return *this;
    }
    double method_count() const {
        return std::max(method.effective_count(), implied.effective_count());
    }
    /// Of the side that has fewer.
    double effective_count() const { return std::min(method_count(), reference.effective_count()); }
};

/// A class is compared where both sides can make it, and where both have enough effective contributions for a t-test.
/// What a class is compared with is the first reference, unless a later one knows the class much better.
///
/// **Lost classes.** A method that never makes a class that it claims has no contributions there. It must not be excused
/// as a side with too few, so it counts as many contributions as it *should* have, where that is known. Let R be a
/// reference whose techniques the method M has too, with at least the same counts, and let both use the power heuristic.
/// For a path x let a_q = n_q p_q(x) and S = (Σ_{q ∈ R} a_q²)^½. A contribution of R by its strongest technique is
/// v_R = f max_q a_q / S² ≥ f / (√2 S) where R has two techniques. One of M is f a_q / Σ_M a². For q ∈ R this is at most
/// that of R by the same technique. For others it is at most f a_q / (S² + a_q²) ≤ f / (2S) < v_R. So no contribution of
/// M exceeds v_R. The second moment of one sample of M is ∫ f Σ_q w_q v_q ≤ ∫ f v_R, and that of R is at least 1/1.21 of
/// ∫ f v_R. Hence with equal samples M has at least 1/1.21 of R's effective contributions (Σv)² / Σv².
/// Roulette, which references do without, makes contributions fewer and larger. kRouletteMargin allows for it: M is
/// credited with a tenth. A light path that many eye paths share makes contributions come in clusters; then M is credited
/// with a hundredth. Where M has no such reference, or is credited with too few, a lost class remains "too rare", and the
/// report names it.
///
/// The credit changes which classes are tested, never the test. Under the hypothesis that M is right, its sum over a
/// class is that of at least kEnoughContributions effective contributions, as with all other classes, so the test keeps
/// its level.
class CommonClasses {
public:
    CommonClasses(const RunSeries& method, std::span<const RunSeries> references);

    struct Class {
        bool is_reachable = false;  ///< Both sides can make it.
        bool is_common = false;     ///< It is compared.
        size_t reference = 0;       ///< Which one it is compared with, or would be.
        bool is_implied = false;    ///< That reference tells what the method should have.
        SideTallies found;          ///< Over all runs.
        double light = 0;           ///< Luminance, the reference's where it is compared.
    };
    const std::map<PathClass, Class>& all() const { return classes_; }
    const Class* find(const PathClass& c) const {
        const auto found = classes_.find(c.without_length_of_edges());
        return found == classes_.end() ? nullptr : &found->second;
    }
    bool contains(const PathClass& c) const {
        const Class* found = find(c);
        return found && found->is_common;
    }
    /// Whether a reference may serve the method: a later one must not be the method itself.
    bool may_serve(size_t reference) const { return may_serve_[reference]; }
    /// What the method should have found where `reference` found `tally`; nothing where that is not known.
    Tally implied_by(size_t reference, const Tally& tally) const {
        return implies_[reference] ? tally.from_fewer_samples(fewer_[reference]) : Tally{};
    }

    /// Contributions to the compared classes for which `belongs(class)`.
    template <class Belongs>
    SideTallies found(const Belongs& belongs) const {
        SideTallies sum;
        for (const auto& [c, k] : classes_)
            if (k.is_common && belongs(c)) sum += k.found;
        return sum;
    }
    /// Light of all classes for which `belongs(class)`, and the shares of it that are left out.
    struct LeftOut {
        double light = 0, out_of_reach = 0, too_rare = 0;
    };
    template <class Belongs>
    LeftOut left_out(const Belongs& belongs) const {
        LeftOut out;
        for (const auto& [c, k] : classes_) {
            if (!belongs(c)) continue;
            out.light += k.light;
            if (!k.is_common) (k.is_reachable ? out.too_rare : out.out_of_reach) += k.light;
        }
        if (out.light > 0) out.out_of_reach /= out.light, out.too_rare /= out.light;
        return out;
    }

private:
    std::map<PathClass, Class> classes_;
    std::vector<bool> may_serve_, implies_;
    std::vector<double>
        fewer_;  ///< Factor by which the method's samples count as fewer than a reference's.
};

}  // namespace etendue
