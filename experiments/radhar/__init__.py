"""RadHAR (Singh et al., mmNets 2019): five activities in the point clouds of a TI IWR1443."""
