#pragma once
// The classes of paths on which a method is compared, and the reference of each class.

#include <map>
#include <span>

#include "verify/run_series.h"

namespace etendue {

/// Contributions of both sides to one mean, and those that the method should have according to the references.
struct SideTallies {
    Tally method, reference, implied;

    SideTallies& operator+=(const SideTallies& o) {
        method += o.method, reference += o.reference, implied += o.implied;
        return *this;
    }
    double method_count() const {
        return std::max(method.effective_count(), implied.effective_count());
    }
    /// That of the side with fewer contributions.
    double effective_count() const { return std::min(method_count(), reference.effective_count()); }
};

/// A class is compared where both sides can make it and have enough effective contributions for a t-test. Its reference
/// is the first one, unless a later one samples the class much better.
///
/// **Lost classes.** A method that never makes a class that it claims to make has no contributions there. The class
/// must not count as too rare then, so the method is credited with the contributions that it *should* have, where these
/// are known. Let R be a reference whose techniques the method M has too, with at least the same counts, and let both
/// use the power heuristic. For a path x let a_q = n_q p_q(x) and S = (Σ_{q ∈ R} a_q²)^½. A contribution of R by its
/// strongest technique is v_R = f max_q a_q / S² ≥ f / (√2 S) where R has two techniques. One of M is f a_q / Σ_M a².
/// For q ∈ R this is at most that of R by the same technique. For others it is at most f a_q / (S² + a_q²) ≤ f / (2S) <
/// v_R. So no contribution of M exceeds v_R. The second moment of one sample of M is ∫ f Σ_q w_q v_q ≤ ∫ f v_R, and
/// that of R is at least 1/1.21 of ∫ f v_R. Hence with equal samples M has at least 1/1.21 of R's effective
/// contributions (Σv)² / Σv². Russian roulette, which references do not use, makes contributions fewer and larger.
/// kRouletteMargin allows for it: M is credited with a tenth. Light paths shared by many eye paths make contributions
/// correlated; then M is credited with a hundredth. Markov chains are credited with nothing: few of their states are
/// independent samples, and those by one technique each. Classes that specular connections make have no credit either, since
/// their contributions are proportional to a number of trials, which has no bound. Where M has no such reference, or the credit
/// is too small, a lost class remains "too rare" and the report names it.
///
/// The credit affects which classes are tested, but not the test. Under the hypothesis that M is unbiased, its sum over
/// a class consists of at least kEnoughContributions effective contributions, as for all other classes, so the level of
/// the test is unchanged.
class CommonClasses {
public:
    CommonClasses(const RunSeries& method, std::span<const RunSeries> references);

    struct Class {
        bool is_reachable = false;  ///< Whether both sides can make it.
        bool is_common = false;     ///< Whether it is compared.
        size_t reference = 0;       ///< Index of its reference.
        bool is_implied = false;    ///< Whether implied_by() is known for this reference.
        SideTallies found;          ///< Contributions of all runs.
        double light = 0;           ///< Luminance; that of the reference where it is compared.
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
    /// Whether the method can be compared with a reference: the first one always, later ones unless they are the
    /// method.
    bool may_serve(size_t reference) const { return may_serve_[reference]; }
    /// Contributions that the method should have where `reference` has `tally`; zero where they are unknown.
    Tally implied_by(size_t reference, const Tally& tally) const {
        return implies_[reference] ? tally.from_fewer_samples(fewer_[reference]) : Tally{};
    }

    /// Contributions to the compared classes that satisfy `belongs(class)`.
    template <class Belongs>
    SideTallies found(const Belongs& belongs) const {
        SideTallies sum;
        for (const auto& [c, k] : classes_)
            if (k.is_common && belongs(c)) sum += k.found;
        return sum;
    }
    /// Light of all classes that satisfy `belongs(class)`, and the shares of it that are not compared.
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
