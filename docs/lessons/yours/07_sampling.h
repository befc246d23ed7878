// ---- 7. Of a = mean, log_var, eps: a sample of N(mean, exp(log_var)), and how far that is from N(0, 1).
Term sample(In a) { return {a[0] + std::exp(a[1] / 2) * a[2], 0, 0}; }
Term kld(In a) { return {(a[0] * a[0] + std::exp(a[1]) - 1 - a[1]) / 2, 0, 0}; }
